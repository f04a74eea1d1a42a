// The main walk: a page dropped, put right, run, looked at and taken away.
import { readFileSync } from "node:fs";
import { expect, test } from "@playwright/test";
import { STAGE, accessible, api, coloured, covered, differing, fileOf, give, open, pixels, sheet } from "./help";

test("a dropped page becomes a model on screen and a file on disk", async ({ page }) => {
  const id = await sheet("0,45,90,180");
  const errors = await open(page);
  await expect(page.getByRole("heading", { name: "Drop a model sheet" })).toBeVisible();
  await accessible(page, "start");

  // Split.
  await give(page, [await fileOf(id, "page.png")]);
  await page.waitForURL(/#\/page\//);
  const boxes = page.getByRole("button", { name: /^Figure \d at/ });
  await expect(boxes).toHaveCount(4);
  await accessible(page, "page");

  // Fix an angle: by the number, then by a key of the dial.
  await page.getByRole("button", { name: /^Figure 2 · / }).click();
  const degrees = page.getByLabel("Angle of figure 2, degrees");
  await degrees.fill("40");
  await degrees.press("Tab");
  await expect(page.getByTestId("saved")).toHaveText("Up to date");
  await expect(page.getByRole("button", { name: "Figure 2 at 40 degrees" })).toBeVisible();
  await page.getByRole("slider", { name: "Angle of figure 2" }).press("ArrowRight");
  await expect(page.getByRole("button", { name: "Figure 2 at 45 degrees" })).toBeVisible();
  // Two at one angle cannot be; both are named.
  await degrees.fill("90");
  await degrees.press("Tab");
  await expect(page.getByText("Figures 2 and 3 are both at 90°")).toBeVisible();
  await expect(page.getByRole("button", { name: "Make the 3D draft of 4 views" })).toBeDisabled();
  await degrees.fill("45");
  await degrees.press("Tab");
  await expect(page.getByTestId("saved")).toHaveText("Up to date");

  // A box by keys: its silhouette is found anew.
  const box = page.getByRole("button", { name: "Figure 4 at 180 degrees" });
  const before = await box.getAttribute("height");
  await box.press("Enter");
  await page.getByRole("button", { name: "Corner of figure 4: bottom right" }).press("ArrowDown");
  await expect(box).not.toHaveAttribute("height", before ?? "");
  await expect(page.getByTestId("saved")).toHaveText("Up to date");
  await page.reload();
  await expect(box).not.toHaveAttribute("height", before ?? "");

  // Run.
  await page.getByRole("button", { name: "Make the 3D draft of 4 views" }).click();
  await page.waitForURL(/#\/job\//);
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.locator(STAGE)).toBeVisible();

  // The mesh is on the screen: far more than grid lines are.
  await page.getByRole("button", { name: "Grid", exact: true }).click();
  const free = await pixels(page, STAGE);
  expect(covered(free)).toBeGreaterThan(0.04);
  await accessible(page, "job");

  // Overlay at 45: the slider blends the drawing over the draft.
  const look = page.getByRole("group", { name: "Look from" });
  await look.getByRole("button", { name: "45°" }).click();
  const blend = page.getByRole("slider", { name: /Drawing over the draft/ });
  await blend.fill("0");
  const draft = await pixels(page, STAGE);
  expect(differing(free, draft)).toBeGreaterThan(0.02);
  await blend.fill("100");
  const drawing = await pixels(page, STAGE);
  expect(differing(draft, drawing)).toBeGreaterThan(0.02);

  // Where outlines differ is coloured, and nowhere else.
  await blend.fill("0");
  await page.getByRole("button", { name: "Difference" }).click();
  await expect(page.getByText("drawn, not in the draft")).toBeVisible();
  const blue = async () => coloured(await pixels(page, STAGE), [47, 107, 255]);
  await expect.poll(blue).toBeGreaterThan(0.0005);
  expect(await blue()).toBeLessThan(0.02);
  await accessible(page, "difference");
  await page.getByRole("button", { name: "Difference" }).click();
  await expect.poll(blue).toBe(0);

  // Two points by keys: the draft is turned between them.
  await look.getByRole("button", { name: "Free" }).click();
  await page.getByRole("button", { name: "Measure" }).click();
  const stage = page.locator(STAGE);
  await stage.press("Space");
  await expect(page.getByText("Click a second point")).toBeVisible();
  await stage.press("ArrowUp");
  await stage.press("Space");
  await expect(page.getByText(/^0\.\d{3} m$/)).toBeVisible();
  await page.getByRole("button", { name: "Measure" }).click();

  for (const [tab, words] of [
    ["Depth", "Point at the map to read a value."],
    ["Numbers", "Lines explained"],
    ["Options used", "turntable.solid.prior"],
  ] as const) {
    await page.getByRole("tab", { name: tab }).click();
    await expect(page.getByText(words, { exact: true })).toBeVisible();
    await accessible(page, tab);
  }
  await page.getByRole("tab", { name: "Depth" }).click();
  const map = page.getByRole("application", { name: /Disparity at 0°/ });
  await expect(page.getByText(/px$/).first()).toBeVisible();
  await map.press("ArrowDown");
  await expect(page.getByText(/column \d+, row \d+: -?\d+\.\d\d px/)).toBeVisible();

  // A reload finds it again.
  await page.reload();
  await expect(page.getByTestId("state")).toHaveText("Done");
  await expect(page.locator(STAGE)).toBeVisible();

  // Take it away.
  const download = page.waitForEvent("download");
  await page.getByRole("button", { name: "Save solid.glb" }).click();
  const saved = readFileSync(await (await download).path());
  expect(saved.subarray(0, 4).toString()).toBe("glTF");
  expect(saved.readUInt32LE(8)).toBe(saved.length);
  expect(await page.context().cookies()).toEqual([]);
  expect(errors).toEqual([]);
});

test("dark and narrow: nothing is lost, nothing sticks out", async ({ page }) => {
  await page.emulateMedia({ colorScheme: "dark" });
  await page.setViewportSize({ width: 390, height: 844 });
  const errors = await open(page);
  const fits = async (state: string) => {
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    expect(wide, state).toBeLessThanOrEqual(390);
    await accessible(page, `${state}, dark and narrow`);
  };
  await fits("start");
  await give(page, [await fileOf(await sheet("0,45,90,180"), "page.png")]);
  await page.waitForURL(/#\/page\//);
  await expect(page.getByRole("button", { name: /^Figure \d at/ })).toHaveCount(4);
  await page.locator("summary", { hasText: /^Options$/ }).click();
  await page.getByText("More options").click();
  await expect(page.getByLabel("Find an option")).toBeVisible();
  await fits("page");
  await page.getByRole("button", { name: /Make the 3D draft/ }).click();
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(page.locator(STAGE)).toBeVisible();
  await fits("job");
  await page.getByRole("button", { name: /Switch to light/ }).click();
  await accessible(page, "job, light by choice");
  expect(errors).toEqual([]);
});

test("a silhouette painted by hand is the one that is used", async ({ page }) => {
  await open(page);
  await give(page, [await fileOf(await sheet("0,45,90,180"), "page.png")]);
  await page.waitForURL(/#\/page\//);
  await page.getByRole("button", { name: "Paint the silhouette" }).click();
  const canvas = page.getByRole("application", { name: /The figure with its silhouette/ });
  await expect(canvas).toBeVisible();
  await accessible(page, "painting");
  await page.getByRole("button", { name: "Erase", exact: true }).click();
  await canvas.focus();
  await page.keyboard.press("Space");
  await page.getByRole("button", { name: "Use this silhouette" }).click();
  const id = /page\/(.*)$/.exec(page.url())?.[1] ?? "";
  const given = async () => {
    const stored = await api<{ figures: { mask_given: boolean }[] }>(`v1/pages/${id}`);
    return stored.figures.map((figure) => figure.mask_given);
  };
  await expect.poll(given).toEqual([true, false, false, false]);
});
