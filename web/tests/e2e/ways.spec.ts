// The other ways in, and what happens when something goes wrong.
import { createServer, request as forward } from "node:http";
import type { AddressInfo } from "node:net";
import { expect, test } from "@playwright/test";
import { zipSync } from "fflate";
import { STAGE, accessible, api, base, fileOf, finished, give, gotoRunning, open, openWaiting, sheet, slow } from "./help";

const text = (name: string, content: string, mimeType = "text/plain") => ({
  name,
  mimeType,
  buffer: Buffer.from(content),
});

test("several drawings with their angles", async ({ page }) => {
  const id = await sheet("0,45,90,180");
  await open(page);
  const files = await Promise.all(
    ["000", "045", "090"].map((name) => fileOf(id, `view_${name}.png`)),
  );
  await give(page, files);
  await expect(page.getByRole("slider", { name: "Angle of figure 2" })).toHaveAttribute(
    "aria-valuenow",
    "45",
  );
  await accessible(page, "several drawings");
  await page.getByLabel("Angle of figure 3, degrees").fill("0");
  await page.keyboard.press("Tab");
  await expect(page.getByText("Figures 1 and 3 are both at 0°")).toBeVisible();
  await page.getByRole("listitem").filter({ hasText: "view_090.png" }).getByRole("button", { name: "Side" }).click();
  // Which way it faces is a choice of its own.
  await page.getByRole("button", { name: /To the right/ }).last().click();
  await expect(page.getByLabel("Angle of figure 3, degrees")).toHaveValue("270");
  await page.getByRole("button", { name: /To the left/ }).last().click();
  await page.getByRole("button", { name: "Make the 3D draft of 3 views" }).click();
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.getByRole("heading", { level: 1 })).toHaveText("view_000.png, view_045.png, view_090.png");
});

test("an archive with its sheet, and a model", async ({ page }) => {
  const id = await sheet("0,45,90,180");
  await open(page);
  const names = ["sheet.json", "view_000.png", "view_045.png", "view_090.png", "view_180.png", "model.obj"];
  const files = await Promise.all(names.map((name) => fileOf(id, name)));
  const zip = zipSync(Object.fromEntries(files.map((file) => [`folder/${file.name}`, new Uint8Array(file.buffer)])));
  await give(page, [{ name: "sheet.zip", mimeType: "application/zip", buffer: Buffer.from(zip) }]);
  await expect(page.getByText("true depths and models to measure against")).toBeVisible();
  await accessible(page, "a sheet document");
  await page.getByRole("button", { name: "Make the 3D draft of 4 views" }).click();
  await page.waitForURL(/#\/job\//);
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });

  await page.goto(base());
  await give(page, [await fileOf(id, "model.obj")]);
  await page.waitForURL(/#\/sheet\//);
  await page.getByRole("button", { name: "Make a 3D draft of it" }).click({ timeout: 90_000 });
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.locator(STAGE)).toBeVisible();
});

test("what cannot be used is said at its place", async ({ page }) => {
  await open(page);
  await give(page, [text("page.png", "no picture", "image/png")]);
  await expect(page.getByRole("alert")).toContainText("At page:");
  await expect(page.getByRole("alert")).toContainText("PNG");
  await accessible(page, "refused");
  await give(page, [text("notes.txt", "x")]);
  await expect(page.getByRole("alert")).toContainText("None of these files can be used");
  await give(page, [text("sheet.zip", "x", "application/zip")]);
  await expect(page.getByRole("alert")).toContainText("This archive cannot be read");
  // A sheet document is the service's to judge.
  await give(page, [text("sheet.json", "{", "application/json")]);
  await expect(page.getByRole("alert")).toContainText("At sheet:");
  await give(page, [text("sheet.json", '{"views": [{"image": "a.png", "azimuth_deg": 0}, {"image": "b.png", "azimuth_deg": 90}]}')]);
  await expect(page.getByRole("alert")).toContainText("no such file was sent");
  await page.goto(`${base()}#/job/01890000-0000-7000-8000-000000000000`);
  await expect(page.getByRole("alert")).toContainText("There is no such reconstruction");
  await accessible(page, "nothing there");
});

test("cancel, several at once, and run again", async ({ page }) => {
  const running = await openWaiting(page);
  await accessible(page, "waiting");
  await page.getByRole("button", { name: "Cancel" }).click();
  await expect(page.getByTestId("state")).toHaveText("Cancelled");
  await gotoRunning(page, running);
  await accessible(page, "running");
  await page.getByRole("button", { name: "Cancel" }).click();
  await expect(page.getByTestId("state")).toHaveText("Cancelled");
  await accessible(page, "cancelled");
  // Again, with other options: the form begins with those of this run.
  await page.getByRole("button", { name: "Run again" }).click();
  await page.getByText("More options").click();
  await page.getByLabel("Find an option").fill("resolution");
  const resolution = page.locator("input[id$='turntable.solid.resolution']");
  await expect(resolution).toHaveValue("400");
  await accessible(page, "options");
  await resolution.fill("64");
  await resolution.press("Tab");
  await page.getByRole("button", { name: "Run", exact: true }).click();
  await expect(page).not.toHaveURL(new RegExp(running));
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 100_000 });
  const id = /job\/(.*)$/.exec(page.url())?.[1] ?? "";
  const job = await api<{ options: { turntable: { solid: { resolution: number } } } }>(`v1/reconstructions/${id}`);
  expect(job.options.turntable.solid.resolution).toBe(64);
});

test("a job that fails says why and how to mend it", async ({ page }) => {
  await open(page);
  const blank = await page.evaluate(async () => {
    const canvas = new OffscreenCanvas(200, 200);
    const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.fillStyle = "#fff";
    context.fillRect(0, 0, 200, 200);
    return [...new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer())];
  });
  const file = (name: string) => ({ name, mimeType: "image/png", buffer: Buffer.from(blank) });
  await give(page, [file("front.png"), file("side.png")]);
  await page.getByRole("button", { name: "Make the 3D draft of 2 views" }).click();
  await expect(page.getByTestId("state")).toHaveText("Failed", { timeout: 60_000 });
  await expect(page.getByRole("alert")).toContainText("blank_view");
  await accessible(page, "failed");
});

test("a drawing from above is looked at from above", async ({ page }) => {
  const id = await sheet("0,90,0@90");
  const form = new FormData();
  for (const [view, name] of [["0", "000"], ["90", "090"], ["0,90", "000_e90"]] as const) {
    const file = await fileOf(id, `view_${name}.png`);
    form.append(`view[${view}]`, new Blob([new Uint8Array(file.buffer)]), file.name);
  }
  const job = await api<{ id: string }>("v1/reconstructions", { method: "POST", body: form });
  const errors = await open(page, `#/job/${job.id}`);
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.locator(STAGE)).toBeVisible();
  const look = page.getByRole("group", { name: "Look from" });
  await look.getByRole("button", { name: "0° raised 90°" }).click();
  await expect(page.getByRole("slider", { name: /Drawing over the draft/ })).toBeVisible();
  await page.getByRole("tab", { name: "Depth" }).click();
  await page.getByRole("combobox", { name: "View" }).selectOption("0° raised 90°");
  const map = page.getByRole("application", { name: /Disparity at 0° raised 90°/ });
  await expect(page.getByText(/\d px$/)).toBeVisible();
  await map.press("ArrowDown");
  await expect(page.getByText(/^column \d+, row \d+: /)).toBeVisible();
  await accessible(page, "from above");
  expect(errors).toEqual([]);
});

test("two drafts are compared with a slider", async ({ page }) => {
  await finished();
  await finished();
  await open(page);
  await expect(page.getByRole("checkbox", { name: /Choose draft/ }).nth(1)).toBeVisible();
  await page.getByRole("checkbox", { name: /Choose draft/ }).nth(0).check();
  await page.getByRole("checkbox", { name: /Choose draft/ }).nth(1).check();
  await page.getByRole("button", { name: "Compare" }).click();
  await expect(page.locator(STAGE)).toBeVisible();
  await page.getByRole("slider", { name: /Where the first ends/ }).fill("30");
  await accessible(page, "compare");
});

test("the key is asked once, wrong and right, and kept for the tab", async ({ page }) => {
  // The service asks for none yet: a door before it does.
  await page.route("**/v1/**", async (route) => {
    const { authorization: key, ...headers } = route.request().headers();
    if (key === "Bearer right") return route.continue({ headers });
    const problem = { type: "/problems/unauthorized", title: "No", status: 401, detail: "no key" };
    return route.fulfill({ status: 401, contentType: "application/problem+json", body: JSON.stringify(problem) });
  });
  await open(page);
  const dialog = page.getByRole("dialog", { name: "This service asks for a key" });
  await expect(dialog).toBeVisible();
  await accessible(page, "key");
  await page.getByLabel("API key").fill("wrong");
  await page.getByRole("button", { name: "Continue" }).click();
  await expect(dialog.getByRole("alert")).toContainText("does not know this key");
  await page.getByLabel("API key").fill("right");
  await page.keyboard.press("Enter");
  await expect(dialog).toBeHidden();
  await expect(page.getByRole("list").last()).toBeVisible();
  await page.reload();
  await expect(page.getByRole("heading", { name: "Recent drafts" })).toBeVisible();
  await expect(dialog).toBeHidden();
  expect(await page.context().cookies()).toEqual([]);
});

test("events that are cut off are taken up, or asked for", async ({ page }) => {
  const asked: (string | undefined)[] = [];
  await page.route("**/events", async (route) => {
    asked.push(route.request().headers()["last-event-id"]);
    if (asked.length > 1) return route.abort();
    // The first event comes through, then the line is cut.
    const body = 'id: 1\nevent: queued\ndata: {"number":1}\n\n';
    return route.fulfill({ status: 200, contentType: "text/event-stream", body });
  });
  const id = await slow();
  await open(page, `#/job/${id}`);
  await expect.poll(() => asked.length, { timeout: 20_000 }).toBeGreaterThan(2);
  expect(asked.slice(0, 2)).toEqual([undefined, "1"]);
  await expect(page.getByText("events do not get through")).toBeVisible();
  await page.getByRole("button", { name: "Cancel" }).click();
  await expect(page.getByTestId("state")).toHaveText("Cancelled");
});

test("without a connection the page says so and goes on by itself", async ({ page, context }) => {
  const id = await slow();
  await open(page, `#/job/${id}`);
  await expect(page.getByTestId("state")).toHaveText(/Running|Waiting/);
  await context.setOffline(true);
  // The stream that is open may live on; a new look at the job does not.
  await page.getByRole("button", { name: "Cancel" }).click();
  await expect(page.getByRole("alert")).toContainText("cannot be reached");
  await accessible(page, "offline");
  await context.setOffline(false);
  await page.getByRole("button", { name: "Cancel" }).click();
  await expect(page.getByTestId("state")).toHaveText("Cancelled");
});

test("it works below a path of a proxy", async ({ page }) => {
  const target = new URL(base());
  const proxy = createServer((incoming, answer) => {
    if (!incoming.url?.startsWith("/studio/sheets/")) {
      answer.writeHead(404).end("not here");
      return;
    }
    const path = incoming.url.slice("/studio/sheets".length);
    // The host goes along as the browser named it: its origin must be the page's.
    const { method, headers } = incoming;
    const sent = forward(
      { host: target.hostname, port: target.port, path, method, headers },
      (got) => {
        answer.writeHead(got.statusCode ?? 502, got.headers);
        got.pipe(answer);
      },
    );
    incoming.pipe(sent);
  });
  await new Promise<void>((done) => proxy.listen(0, "127.0.0.1", done));
  const { port } = proxy.address() as AddressInfo;
  const errors = await open(page, "", `http://127.0.0.1:${port}/studio/sheets/`);
  await give(page, [await fileOf(await sheet("0,45,90,180"), "page.png")]);
  await page.waitForURL(/studio\/sheets\/#\/page\//);
  await page.getByRole("button", { name: /Make the 3D draft/ }).click();
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.locator(STAGE)).toBeVisible();
  expect(errors).toEqual([]);
  proxy.closeAllConnections();
  proxy.close();
});
