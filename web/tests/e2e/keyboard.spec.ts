// Everything by keys: what can be reached, what is seen to be, and a way to do
// what the pointer does by dragging.
import { type Page, expect, test } from "@playwright/test";
import {
  STAGE,
  api,
  base,
  differing,
  fileOf,
  finished,
  give,
  gotoRunning,
  matched,
  open,
  openWaiting,
  pixels,
  sheet,
} from "./help";
import { walk } from "./keys";

const idOf = (page: Page) => /(?:page|job)\/(.*)$/.exec(page.url())?.[1] ?? "";

async function openPage(page: Page) {
  await open(page);
  await give(page, [await fileOf(await sheet("0,45,90,180"), "page.png")]);
  await page.waitForURL(/#\/page\//);
  await expect(page.getByRole("button", { name: /^Figure \d at/ })).toHaveCount(4);
}

async function openJob(page: Page, id: string) {
  await page.goto(`${base()}#/job/${id}`);
  await expect(page.locator(STAGE)).toBeVisible();
}

const narrow = (page: Page) => page.setViewportSize({ width: 390, height: 844 });

test("the start, with what was made before, and what cannot be used", async ({ page }) => {
  await finished();
  await finished();
  await openPage(page);
  await page.goto(base());
  await expect(page.getByRole("heading", { name: "Recent pages" })).toBeVisible();
  await expect(page.getByRole("checkbox", { name: /Choose draft/ }).nth(1)).toBeVisible();
  await walk(page, "start");
  await give(page, [{ name: "page.png", mimeType: "image/png", buffer: Buffer.from("x") }]);
  await expect(page.getByRole("alert")).toBeVisible();
  await walk(page, "refused");
  await narrow(page);
  await walk(page, "start, narrow");
});

test("several drawings, and a page with its tools", async ({ page }) => {
  const id = await sheet("0,45,90,180");
  await open(page);
  await give(page, await Promise.all(["000", "045", "090"].map((name) => fileOf(id, `view_${name}.png`))));
  await expect(page.getByRole("button", { name: "Check the silhouettes" })).toBeVisible();
  await walk(page, "several drawings");

  await openPage(page);
  await walk(page, "page");
  // Passing by the boxes chose none of them.
  await expect(page.getByRole("button", { name: "Figure 1 at 0 degrees" })).toHaveAttribute("aria-pressed", "true");
  await page.getByRole("button", { name: "Figure 3 at 90 degrees" }).press("Enter");
  await expect(page.getByRole("slider", { name: "Angle of figure 3" })).toBeVisible();
  await page.getByRole("button", { name: /^Figure 2 · / }).press("Enter");
  await page.getByText("Axis, ground and size").press("Enter");
  await page.locator("summary", { hasText: /^Options$/ }).press("Enter");
  await page.getByText("More options").press("Enter");
  await page.getByLabel("Find an option").fill("resolution");
  await walk(page, "page, options");
  await page.getByRole("button", { name: "Erase an area" }).press("Enter");
  const area = page.getByRole("application", { name: /Erase an area/ });
  for (const key of ["Space", "ArrowLeft", "Space", "ArrowUp", "Space"]) await area.press(key);
  await expect(page.getByText("3 so far")).toBeVisible();
  await narrow(page);
  await walk(page, "page, marking, narrow");
});

test("painting keeps the keys within and gives them back", async ({ page }) => {
  await openPage(page);
  const paint = page.getByRole("button", { name: "Paint the silhouette" });
  await paint.press("Enter");
  const canvas = page.getByRole("application", { name: /The figure with its silhouette/ });
  await expect(canvas).toBeVisible();
  await walk(page, "painting");
  await page.keyboard.press("Escape");
  // It is closed before it is gone.
  await expect(page.locator("dialog canvas")).toHaveCount(0);
  await expect(paint).toBeFocused();
  await paint.press("Enter");
  await page.getByRole("button", { name: "Erase", exact: true }).press("Space");
  for (const key of ["ArrowUp", "Space"]) await canvas.press(key);
  await page.getByRole("button", { name: "Use this silhouette" }).press("Enter");
  await expect(paint).toBeFocused();
  await expect(page.getByTestId("saved")).toHaveText("Up to date");
  await expect(paint).toBeFocused();
});

test("what is dragged is moved by keys", async ({ page }) => {
  await openPage(page);
  const figure = async () =>
    (await api<{ figures: { box: { left: number; bottom: number }; ground_y: number | null; axis_x: number | null }[] }>(
      `v1/pages/${idOf(page)}`,
    )).figures[0];
  const before = await figure();
  await page.getByRole("button", { name: "Figure 1 at 0 degrees" }).press("ArrowRight");
  await expect.poll(async () => (await figure())?.box.left).toBeGreaterThan(before?.box.left ?? Infinity);
  await page.getByRole("button", { name: "Corner of figure 1: bottom left" }).press("ArrowUp");
  await expect.poll(async () => (await figure())?.box.bottom).toBeLessThan(before?.box.bottom ?? 0);
  await page.getByRole("slider", { name: "Ground of figure 1, row" }).press("ArrowUp");
  await expect.poll(async () => (await figure())?.ground_y).toBeGreaterThan(0);
  await page.getByRole("slider", { name: "Turning axis of figure 1, column" }).press("ArrowLeft");
  await expect.poll(async () => (await figure())?.axis_x).toBeGreaterThan(0);
  // The focus is where it was: a line is moved by many presses.
  await expect(page.getByRole("slider", { name: "Turning axis of figure 1, column" })).toBeFocused();
  // It is seen there too, though nothing of the line's own is drawn.
  const line = "svg .grip.axis";
  const lit = await pixels(page, ".sheet");
  await page.locator(line).first().evaluate((node) => (node as SVGElement).blur());
  expect(differing(lit, await pixels(page, ".sheet"))).toBeGreaterThan(0.0005);
  for (const name of ["Figure 1 at 0 degrees", "Corner of figure 1: top left"]) {
    const plain = await pixels(page, ".sheet");
    await page.getByRole("button", { name }).focus();
    await page.keyboard.press("Shift");
    expect(differing(plain, await pixels(page, ".sheet")), name).toBeGreaterThan(0.0002);
    await page.getByRole("button", { name }).blur();
  }
});

test("a job that waits, runs, is cancelled and fails", async ({ page }) => {
  const running = await openWaiting(page);
  await walk(page, "waiting");
  await page.getByRole("button", { name: "Cancel" }).press("Enter");
  await expect(page.getByTestId("state")).toHaveText("Cancelled");
  await gotoRunning(page, running);
  await walk(page, "running");
  await page.getByRole("button", { name: "Cancel" }).press("Enter");
  await expect(page.getByTestId("state")).toHaveText("Cancelled");
  await page.getByRole("button", { name: "Run again" }).press("Enter");
  await expect(page.getByRole("button", { name: "Run", exact: true })).toBeVisible();
  await page.getByText("More options").press("Enter");
  await walk(page, "run again");
  await page.getByRole("button", { name: "Delete" }).press("Enter");
  await expect(page.getByRole("button", { name: "Keep it" })).toBeFocused();
  await walk(page, "delete?");
  await page.getByRole("button", { name: "Keep it" }).press("Enter");
  await expect(page.getByRole("button", { name: "Delete" })).toBeFocused();

  const blank = await page.evaluate(async () => {
    const canvas = new OffscreenCanvas(200, 200);
    const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
    context.fillStyle = "#fff";
    context.fillRect(0, 0, 200, 200);
    return [...new Uint8Array(await (await canvas.convertToBlob()).arrayBuffer())];
  });
  const form = new FormData();
  for (const view of [0, 90]) form.append(`view[${view}]`, new Blob([new Uint8Array(blank)]), `${view}.png`);
  const failed = await api<{ id: string }>("v1/reconstructions", { method: "POST", body: form });
  await page.goto(`${base()}#/job/${failed.id}`);
  await expect(page.getByTestId("state")).toHaveText("Failed", { timeout: 60_000 });
  await walk(page, "failed");
});

test("a draft, in each tab", async ({ page }) => {
  await open(page);
  await openJob(page, await finished());
  for (const tab of ["Outlines", "Depth", "Numbers", "Options used"]) {
    // One of the tabs is a stop, the others are reached by arrows.
    await expect(page.getByRole("tab", { name: tab })).toHaveAttribute("aria-selected", "true");
    if (tab === "Numbers") await page.getByText("All numbers as JSON").press("Enter");
    await walk(page, `draft, ${tab}`);
    await page.getByRole("tab", { name: tab }).press("ArrowRight");
  }
  await expect(page.getByRole("tab", { name: "Outlines" })).toBeFocused();
  await page.getByRole("tab", { name: "Outlines" }).press("End");
  await expect(page.getByRole("tab", { name: "Options used" })).toBeFocused();

  await page.getByRole("group", { name: "Look from" }).getByRole("button", { name: "45°" }).press("Enter");
  const blend = page.getByRole("slider", { name: /Drawing over the draft/ });
  await blend.press("ArrowRight");
  await expect(blend).toHaveValue("51");
  await page.getByRole("button", { name: "Difference" }).press("Enter");
  await page.getByRole("button", { name: "Measure" }).press("Enter");
  await page.getByText(/^All files/).press("Enter");
  await narrow(page);
  await walk(page, "draft, overlay, narrow");

  // The draft turns, comes nearer, and goes back.
  const stage = page.locator(STAGE);
  await page.getByRole("button", { name: "Measure" }).press("Enter");
  let before = await pixels(page, STAGE);
  for (const key of ["ArrowLeft", "+", "0"]) {
    await stage.press(key);
    const now = await pixels(page, STAGE);
    expect(differing(before, now), key).toBeGreaterThan(0.005);
    before = now;
  }
});

test("two drafts with their slider, and a drawn sheet", async ({ page }) => {
  const [one, other] = [await finished(), await finished()];
  await open(page, `#/compare/${one}/${other}`);
  await expect(page.locator(STAGE)).toBeVisible();
  await walk(page, "compare");
  const split = page.getByRole("slider", { name: /Where the first ends/ });
  await split.press("ArrowLeft");
  await expect(split).toHaveValue("49");
  await page.goto(`${base()}#/sheet/${await sheet("0,45,90,180")}`);
  await expect(page.getByRole("button", { name: "Make a 3D draft of it" })).toBeVisible();
  await walk(page, "drawn sheet");
});

test("matches of a pair", async ({ page }) => {
  await open(page);
  await openJob(page, await matched());
  // A hull has no colours for what is seen, bounded or guessed.
  await expect(page.getByRole("combobox", { name: "Surface" })).toBeHidden();
  await expect(page.getByRole("button", { name: /^Match 1, left end/ })).toBeVisible();
  await walk(page, "matches");
  const before = Number(await page.getByRole("spinbutton", { name: "Match" }).getAttribute("max"));
  const end = page.getByRole("button", { name: /^Match 1, left end/ });
  const name = await end.getAttribute("aria-label");
  await end.press("ArrowDown");
  await expect(end).not.toHaveAttribute("aria-label", name ?? "");
  await expect(end).toBeFocused();
  await end.press("Delete");
  await expect(page.getByText(`of ${before - 1}`)).toBeVisible();
  await expect(end).toBeFocused();
  await narrow(page);
  await walk(page, "matches, narrow");
});

test("the key is asked for, and there is no way round it", async ({ page }) => {
  await page.route("**/v1/**", (route) => {
    const problem = { type: "/problems/unauthorized", title: "No", status: 401, detail: "no key" };
    return route.fulfill({ status: 401, contentType: "application/problem+json", body: JSON.stringify(problem) });
  });
  await open(page);
  await expect(page.getByLabel("API key")).toBeFocused();
  await walk(page, "key");
  for (let presses = 0; presses < 3; presses += 1) await page.keyboard.press("Escape");
  await expect(page.getByRole("dialog")).toBeVisible();
});

test("from a sample to a draft by keys alone", async ({ page }) => {
  await open(page);
  /** Presses Tab until this has the focus. */
  const reach = async (name: string | RegExp, role: "button" | "slider" | "tab" = "button") => {
    const wanted = page.getByRole(role, { name }).first();
    await expect(wanted).toBeEnabled();
    for (let presses = 0; presses < 120; presses += 1) {
      if (await wanted.evaluate((node) => node === document.activeElement)) return;
      await page.keyboard.press("Tab");
    }
    throw new Error(`${String(name)} is not reached`);
  };
  await reach("Try a sample sheet");
  await page.keyboard.press("Enter");
  await page.waitForURL(/#\/page\//, { timeout: 60_000 });
  await reach(/Make the 3D draft of 4 views/);
  await page.keyboard.press("Enter");
  await page.waitForURL(/#\/job\//);
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.locator(STAGE)).toBeVisible();
  await reach("45°");
  await page.keyboard.press("Enter");
  await reach(/Drawing over the draft/, "slider");
  await reach("Save solid.glb");
  const download = page.waitForEvent("download");
  await page.keyboard.press("Enter");
  expect((await download).suggestedFilename()).toBe("solid.glb");
});
