// What the tests of the page share.
import AxeBuilder from "@axe-core/playwright";
import { type Page, expect } from "@playwright/test";


export const base = () => process.env["TURNAROUND_URL"] ?? "";

/** Answers JSON of the service itself, beside the page. */
export async function api<T>(path: string, init?: RequestInit): Promise<T> {
  const response = await fetch(base() + path, init);
  if (!response.ok) throw new Error(`${response.status} ${await response.text()}`);
  return (await response.json()) as T;
}

const drawn = new Map<string, string>();

/** The id of a drawn sheet of a built-in model; each is drawn once. */
export async function sheet(azimuths: string, model = "caped_figure"): Promise<string> {
  const known = drawn.get(model + azimuths);
  if (known) return known;
  const form = new FormData();
  form.append("model", `builtin:${model}`);
  form.append("azimuths", azimuths);
  let job = await api<{ id: string; state: string }>("v1/sheets", { method: "POST", body: form });
  while (job.state === "queued" || job.state === "running") {
    job = await api(`v1/sheets/${job.id}`, { headers: { Prefer: "wait=20" } });
  }
  expect(job.state).toBe("succeeded");
  drawn.set(model + azimuths, job.id);
  return job.id;
}

/** A file of a drawn sheet, as an upload. */
export async function fileOf(id: string, name: string, as = name) {
  const response = await fetch(`${base()}v1/sheets/${id}/artifacts/${name}`);
  expect(response.status).toBe(200);
  const mimeType = response.headers.get("content-type") ?? "application/octet-stream";
  return { name: as, mimeType, buffer: Buffer.from(await response.arrayBuffer()) };
}

/** The id of a finished draft of a drawn sheet. */
export async function finished(): Promise<string> {
  const id = await sheet("0,45,90,180");
  const form = new FormData();
  const page = await fileOf(id, "page.png");
  form.append("page", new Blob([new Uint8Array(page.buffer)]), "page.png");
  let job = await api<{ id: string; state: string }>("v1/reconstructions", { method: "POST", body: form });
  while (job.state === "queued" || job.state === "running") {
    job = await api(`v1/reconstructions/${job.id}`, { headers: { Prefer: "wait=20" } });
  }
  expect(job.state).toBe("succeeded");
  return job.id;
}

/** A finished job of the method with matches. */
export async function matched(): Promise<string> {
  const azimuths = [0, 5, 10];
  const id = await sheet(azimuths.join(","));
  const form = new FormData();
  for (const azimuth of azimuths) {
    const file = await fileOf(id, `view_${String(azimuth).padStart(3, "0")}.png`);
    form.append(`view[${azimuth}]`, new Blob([new Uint8Array(file.buffer)]), file.name);
  }
  form.append("method", "uncalibrated");
  let job = await api<{ id: string; state: string; failure: unknown }>("v1/reconstructions", { method: "POST", body: form });
  while (job.state === "queued" || job.state === "running") {
    job = await api(`v1/reconstructions/${job.id}`, { headers: { Prefer: "wait=20" } });
  }
  expect(job.state, JSON.stringify(job.failure)).toBe("succeeded");
  return job.id;
}

/** A job that takes long: many views, a fine solid. */
export async function slow(): Promise<string> {
  const id = await sheet("0:90:10,180");
  const form = new FormData();
  const document = await (await fetch(`${base()}v1/sheets/${id}/artifacts/sheet.json`)).text();
  const parsed = JSON.parse(document) as { views: { image: string; depth?: string }[]; truth?: unknown };
  delete parsed.truth;
  for (const view of parsed.views) {
    delete view.depth;
    const file = await fileOf(id, view.image);
    form.append("image", new Blob([new Uint8Array(file.buffer)]), view.image);
  }
  form.append("sheet", new Blob([JSON.stringify(parsed)], { type: "application/json" }));
  form.append("turntable.solid.resolution", "400");
  return (await api<{ id: string }>("v1/reconstructions", { method: "POST", body: form })).id;
}

/** Opens a job that waits for one that runs; the id of that. */
export async function openWaiting(page: Page): Promise<string> {
  const running = await slow();
  const queued = await slow();
  await open(page, `#/job/${queued}`);
  await expect(page.getByTestId("state")).toHaveText("Waiting");
  return running;
}

/** Goes on to a job that runs. */
export async function gotoRunning(page: Page, id: string) {
  await page.goto(`${base()}#/job/${id}`);
  await expect(page.getByTestId("state")).toHaveText("Running");
}

/** Gives files to the page as the file picker does. */
export async function give(page: Page, files: Awaited<ReturnType<typeof fileOf>>[]) {
  await page.getByTestId("files").setInputFiles(files);
}

/** Opens the page, and fails the test for what it logs as an error. */
export async function open(page: Page, hash = "", url = base()) {
  const errors: string[] = [];
  page.on("pageerror", (error) => errors.push(error.message));
  page.on("console", (message) => {
    // A refused request is logged by the browser; what is done about it is tested.
    if (message.type() === "error" && !/Failed to load resource/.test(message.text())) {
      errors.push(message.text());
    }
  });
  await page.goto(url + hash);
  return errors;
}

/** No violation of WCAG 2.2 AA or of good practice. */
export async function accessible(page: Page, state: string) {
  // The same page, typed by the library's own copy of the driver.
  const found = await new AxeBuilder({ page: page as never }).analyze();
  const told = found.violations.map(
    (one) => `${one.id}: ${one.help} ${one.nodes.map((node) => node.target.join(" ")).join(", ")}`,
  );
  expect(told, `axe: ${state}`).toEqual([]);
}

/** The pixels of an element as they are on the screen. */
export async function pixels(page: Page, selector: string): Promise<Uint8Array> {
  const picture = await page.locator(selector).first().screenshot();
  const values = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes]));
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.drawImage(bitmap, 0, 0);
    const { data } = context.getImageData(0, 0, bitmap.width, bitmap.height);
    let text = "";
    for (let k = 0; k < data.length; k += 8192) text += String.fromCharCode(...data.subarray(k, k + 8192));
    return btoa(text);
  }, picture.toString("base64"));
  return new Uint8Array(Buffer.from(values, "base64"));
}

/** Share of pixels that differ by more than a few levels. */
export function differing(a: Uint8Array, b: Uint8Array): number {
  expect(a.length).toBe(b.length);
  let count = 0;
  for (let k = 0; k < a.length; k += 4) {
    const apart = [0, 1, 2].some((c) => Math.abs((a[k + c] ?? 0) - (b[k + c] ?? 0)) > 12);
    if (apart) count += 1;
  }
  return count / (a.length / 4);
}

/** Share of pixels of about this colour. */
export function coloured(picture: Uint8Array, colour: number[]): number {
  let count = 0;
  for (let k = 0; k < picture.length; k += 4) {
    if (colour.every((level, c) => Math.abs((picture[k + c] ?? 0) - level) <= 12)) count += 1;
  }
  return count / (picture.length / 4);
}

/** Share of pixels that are not of the commonest colour. */
export function covered(picture: Uint8Array): number {
  const counts = new Map<number, number>();
  for (let k = 0; k < picture.length; k += 4) {
    const colour =
      ((picture[k] ?? 0) << 16) | ((picture[k + 1] ?? 0) << 8) | (picture[k + 2] ?? 0);
    counts.set(colour, (counts.get(colour) ?? 0) + 1);
  }
  return 1 - Math.max(...counts.values()) / (picture.length / 4);
}

export const STAGE = "canvas[data-ready=true]";
