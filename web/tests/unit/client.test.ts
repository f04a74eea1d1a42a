import { afterEach, expect, it, vi } from "vitest";

vi.mock("../../src/api/key.svelte", () => ({ key: { value: null } }));
import { ask } from "../../src/api/client";

afterEach(() => {
  vi.unstubAllGlobals();
});

it("asks for the bytes, not for where they are", async () => {
  const preferred: (string | null)[] = [];
  vi.stubGlobal("document", { baseURI: "http://localhost/" });
  vi.stubGlobal("fetch", (_: string, init: RequestInit) => {
    preferred.push(new Headers(init.headers).get("Prefer"));
    return Promise.resolve(new Response("{}"));
  });
  await ask("v1/reconstructions/1/artifacts/solid.glb");
  await ask("v1/reconstructions/1", { headers: { Prefer: "wait=30" } });
  expect(preferred).toEqual(["no-redirect", "wait=30, no-redirect"]);
});
