// What is put right by hand reaches the service: places and marks of figures,
// matches of pairs; and what is found again from the start.
import { type Page, expect, test } from "@playwright/test";
import { accessible, api, base, fileOf, finished, give, matched, open, sheet } from "./help";

interface Figure {
  axis_x: number | null;
  ground_y: number | null;
  elevation_deg: number;
  erase: number[][][];
  attach: number[][];
  holes: number[][];
}

/** The sheet that a page makes. */
interface Made {
  views: { axis_x?: number; erase?: number[][][]; ignore?: number[][]; mirrored?: boolean; mask_with_outline?: boolean }[];
  holes: { azimuth_deg: number }[];
}

const idOf = (page: Page) => /(?:page|job)\/(.*)$/.exec(page.url())?.[1] ?? "";

async function openPage(page: Page) {
  const errors = await open(page);
  await give(page, [await fileOf(await sheet("0,45,90,180"), "page.png")]);
  await page.waitForURL(/#\/page\//);
  await expect(page.getByRole("button", { name: /^Figure \d at/ })).toHaveCount(4);
  return errors;
}

/** Dark and as narrow as a phone: nothing sticks out, nothing is hard to read. */
async function narrow(page: Page, state: string) {
  await page.emulateMedia({ colorScheme: "dark" });
  await page.setViewportSize({ width: 390, height: 844 });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  expect(wide, state).toBeLessThanOrEqual(390);
  await accessible(page, `${state}, dark and narrow`);
}

const figureOf = async (page: Page, number: number) =>
  (await api<{ figures: Figure[] }>(`v1/pages/${idOf(page)}`)).figures[number] as Figure;

test("axis, ground, elevation and marks reach the document", async ({ page }) => {
  const errors = await openPage(page);
  // The axis by keys.
  const axis = page.getByRole("slider", { name: "Turning axis of figure 1, column" });
  const column = Number(await axis.getAttribute("aria-valuenow"));
  await axis.press("ArrowRight");
  await expect.poll(async () => (await figureOf(page, 0)).axis_x).toBeCloseTo(column + 5, -1);
  // The ground by the pointer.
  const ground = page.getByRole("slider", { name: "Ground of figure 1, row" });
  const line = await ground.boundingBox();
  if (!line) throw new Error("no ground line");
  const row = Number(await ground.getAttribute("aria-valuenow"));
  const [x, y] = [line.x + line.width * 0.75, line.y + line.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x, y + 12, { steps: 3 });
  await page.mouse.up();
  await expect.poll(async () => (await figureOf(page, 0)).ground_y ?? 0).toBeGreaterThan(row + 3);

  // An area is erased by clicks, ended by its button.
  await page.getByRole("button", { name: "Erase an area" }).click();
  const canvas = page.getByRole("application", { name: /Figure 1: Erase an area/ });
  await accessible(page, "erasing");
  const box = await page.getByRole("button", { name: "Figure 1 at 0 degrees" }).boundingBox();
  const whole = await canvas.boundingBox();
  if (!box || !whole) throw new Error("no box");
  const at = (fx: number, fy: number) => ({
    x: box.x - whole.x + box.width * fx,
    y: box.y - whole.y + box.height * fy,
  });
  for (const position of [at(0.05, 0.05), at(0.3, 0.05), at(0.3, 0.2)]) await canvas.click({ position });
  await expect(page.getByText("3 so far")).toBeVisible();
  await page.getByRole("button", { name: "End the area" }).click();
  await expect(page.getByText("Erased area 1").first()).toBeVisible();
  await expect.poll(async () => (await figureOf(page, 0)).erase[0]?.length).toBe(3);

  // A hole by keys alone.
  await page.getByRole("button", { name: "Mark a hole" }).click();
  const marking = page.getByRole("application", { name: /Figure 1: Mark a hole/ });
  await marking.press("ArrowDown");
  await marking.press("Space");
  await expect.poll(async () => (await figureOf(page, 0)).holes.length).toBe(1);
  await page.getByRole("button", { name: "Attach a piece" }).click();
  await page.getByRole("application", { name: /Figure 1: Attach a piece/ }).press("Space");
  await expect.poll(async () => (await figureOf(page, 0)).attach.length).toBe(1);
  await accessible(page, "marked");
  await page.getByRole("button", { name: "Remove Hole 1" }).click();
  await expect.poll(async () => (await figureOf(page, 0)).holes.length).toBe(0);

  // The last one is seen from above.
  await page.getByRole("button", { name: "Move boxes" }).click();
  await page.getByRole("button", { name: /^Figure 4 · / }).click();
  await page.getByRole("button", { name: "From above" }).click();
  await expect.poll(async () => (await figureOf(page, 3)).elevation_deg).toBe(90);
  const { sheet: made } = await api<{ sheet: { views: { axis_x?: number; elevation_deg?: number }[] } }>(
    `v1/pages/${idOf(page)}`,
  );
  expect(made.views[0]?.axis_x).toBeGreaterThan(0);
  expect(made.views[3]?.elevation_deg).toBe(90);
  await page.getByRole("button", { name: "Draw the outline" }).click();
  await narrow(page, "marks");
  expect(errors).toEqual([]);
});

test("several drawings are checked and marked, and used as sent", async ({ page }) => {
  const id = await sheet("0,45,90,180");
  const files = await Promise.all(["000", "045", "090"].map((name) => fileOf(id, `view_${name}.png`)));
  const model = async () => {
    await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
    const answer = await fetch(`${base()}v1/reconstructions/${idOf(page)}/artifacts/solid.glb`);
    return Buffer.from(await answer.arrayBuffer());
  };
  // A broken one is named.
  const errors = await open(page);
  await give(page, [files[0] as never, { ...(files[1] as object), buffer: Buffer.from("x") } as never]);
  await page.getByRole("button", { name: "Check the silhouettes" }).click();
  const broken = page.getByRole("listitem").filter({ hasText: "view_045.png" });
  await expect(broken.getByRole("alert")).toContainText("is not a PNG");
  await accessible(page, "a drawing refused");
  await page.reload();

  await give(page, files);
  await page.getByRole("button", { name: "Make the 3D draft of 3 views" }).click();
  const sent = await model();

  // As figures of a page they are what was sent: the same draft to the byte.
  await page.goto(base());
  await give(page, files);
  await page.getByRole("button", { name: "Check the silhouettes" }).click();
  await page.waitForURL(/#\/page\//);
  await expect(page.getByText("Not used (0)")).toBeVisible();
  await accessible(page, "drawings checked");
  await page.getByRole("button", { name: "Make the 3D draft of 3 views" }).click();
  expect(sent.equals(await model())).toBe(true);

  // Marked by keys, the second: in its own pixels.
  await page.getByRole("link", { name: "Back to its page" }).click();
  await page.getByRole("button", { name: "Picture 2 of 3" }).click();
  const axis = page.getByRole("slider", { name: "Turning axis of figure 2, column" });
  const column = Number(await axis.getAttribute("aria-valuenow"));
  await axis.press("ArrowRight");
  await page.getByRole("button", { name: "Leave a piece out" }).click();
  await page.getByRole("application", { name: /Figure 2: Leave a piece out/ }).press("Space");
  await page.getByRole("button", { name: "Erase an area" }).click();
  const area = page.getByRole("application", { name: /Figure 2: Erase an area/ });
  for (const key of ["Space", "ArrowLeft", "Space", "ArrowUp", "Space", "Enter"]) await area.press(key);
  await page.getByRole("button", { name: "Mark a hole" }).click();
  await page.getByRole("application", { name: /Figure 2: Mark a hole/ }).press("Space");
  await page.getByRole("checkbox", { name: "The drawing is mirrored" }).check();
  const made = async () => (await api<{ sheet: Made }>(`v1/pages/${idOf(page)}`)).sheet;
  await expect.poll(async () => (await made()).views[1]?.mirrored).toBe(true);
  const { views, holes } = await made();
  expect(views[1]?.axis_x).toBeCloseTo(column + 5, -1);
  expect(views[1]?.erase?.[0]).toHaveLength(3);
  expect(views[1]?.ignore).toHaveLength(1);
  expect(holes).toMatchObject([{ azimuth_deg: 45 }]);
  expect([views[0]?.axis_x ?? null, views[2]?.axis_x ?? null]).toEqual([null, null]);
  await narrow(page, "drawings marked");
  expect(errors).toEqual([]);
});

test("a sheet document is checked like other drawings, and used as it says", async ({ page }) => {
  const id = await sheet("0,45,90,180");
  const files = await Promise.all(
    ["view_000", "view_045", "view_090", "view_180", "mask_045", "mask_180"].map((name) => fileOf(id, `${name}.png`)),
  );
  const mask = { mask: "mask_045.png", mask_with_outline: true };
  const document = {
    name: "hero",
    views: [
      { image: "view_000.png", azimuth_deg: 0, axis_x: 486, ground_y: 500 },
      { image: "view_045.png", azimuth_deg: 45, ...mask },
      { image: "view_090.png", azimuth_deg: 90, erase: [[[0, 0], [40, 0], [40, 40]]], ignore: [[20, 300]] },
      { image: "view_180.png", azimuth_deg: 180, mask: "mask_180.png" },
    ],
    holes: [{ azimuth_deg: 90, x: 480, y: 250 }],
    options: { seed: 3, turntable: { solid: { target_faces: 3000 } } },
  };
  const described = { name: "sheet.json", mimeType: "application/json", buffer: Buffer.from(JSON.stringify(document)) };
  const form = new FormData();
  for (const { name, mimeType, buffer } of [described, ...files]) {
    form.append(name === "sheet.json" ? "sheet" : "image", new Blob([new Uint8Array(buffer)], { type: mimeType }), name);
  }
  form.append("reuse", "false");
  const { id: job } = await api<{ id: string }>("v1/reconstructions", { method: "POST", body: form });

  const errors = await open(page);
  await give(page, [described, ...files]);
  await expect(page.getByRole("slider", { name: "Angle of figure 4" })).toHaveAttribute("aria-valuenow", "180");
  await page.getByRole("button", { name: "Check the silhouettes" }).click();
  await page.waitForURL(/#\/page\//);
  const { sheet: made } = await api<{ sheet: Made }>(`v1/pages/${idOf(page)}`);
  expect(made.views.map((view) => view.mask_with_outline ?? null)).toEqual([null, true, null, null]);
  expect(made).toMatchObject({
    views: [{ axis_x: 486, ground_y: 500 }, { azimuth_deg: 45 }, { ignore: [[20, 300]] }, { azimuth_deg: 180 }],
    holes: [{ azimuth_deg: 90, x: 480, y: 250 }],
  });
  await accessible(page, "a sheet document checked");
  // The options came along, and stay over a reload.
  await page.reload();
  await page.locator("summary", { hasText: /^Options$/ }).click();
  await page.getByText("More options").click();
  await page.getByLabel("Find an option").fill("seed");
  await expect(page.locator("input[id$='-seed']")).toHaveValue("3");
  await page.getByRole("button", { name: "Make the 3D draft of 4 views" }).click();
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  const { reused_from: reused } = await api<{ reused_from?: string }>(`v1/reconstructions/${idOf(page)}`);
  expect(reused ?? null).toBeNull();
  const bytes = async (of: string, name: string) => {
    const answer = await fetch(`${base()}v1/reconstructions/${of}/artifacts/${name}`);
    expect(answer.status).toBe(200);
    return Buffer.from(await answer.arrayBuffer());
  };
  for (const name of ["solid.glb", "solid.obj", "textured.glb", "views/45/silhouette.png"]) {
    expect((await bytes(job, name)).equals(await bytes(idOf(page), name)), name).toBe(true);
  }
  expect(errors).toEqual([]);
});

test("pages are found again, and files are linked to", async ({ page, context, request }) => {
  await openPage(page);
  const id = idOf(page);
  await page.goto(base());
  await expect(page.getByRole("heading", { name: "Recent pages" })).toBeVisible();
  await accessible(page, "pages");
  await page.locator(`a[href="#/page/${id}"]`).click();
  await expect(page.getByRole("button", { name: /^Figure \d at/ })).toHaveCount(4);

  await context.grantPermissions(["clipboard-read", "clipboard-write"]);
  await page.goto(`${base()}#/job/${await finished()}`);
  await page.getByRole("button", { name: "Copy link solid.glb" }).click();
  await expect(page.getByRole("button", { name: "Copied solid.glb" })).toBeVisible();
  const link = await page.evaluate(() => navigator.clipboard.readText());
  const answer = await request.get(link);
  expect((await answer.body()).subarray(0, 4).toString()).toBe("glTF");
});

interface Told {
  matches: { left: number[]; right: number[] }[];
}

test("matches are corrected and run again", async ({ page }) => {
  const id = await matched();
  const errors = await open(page, `#/job/${id}`);
  const pair = (job: string) => api<Told>(`v1/reconstructions/${job}/artifacts/pairs/0-5/matches.json`);
  const before = (await pair(id)).matches;
  await expect(page.getByText(`of ${before.length}`)).toBeVisible();
  await expect(page.getByRole("button", { name: "Run again with these matches" })).toBeDisabled();
  await accessible(page, "matches");

  // One is taken away, one moved by the pointer, one made by keys.
  await page.getByRole("spinbutton", { name: "Match" }).fill("2");
  await page.keyboard.press("Tab");
  await page.getByRole("button", { name: "Remove it" }).click();
  await expect(page.getByText(`of ${before.length - 1}`)).toBeVisible();
  await page.getByRole("spinbutton", { name: "Match" }).fill("1");
  await page.keyboard.press("Tab");
  const end = page.getByRole("button", { name: /^Match 1, left end/ });
  const name = await end.getAttribute("aria-label");
  await end.scrollIntoViewIfNeeded();
  const place = await end.boundingBox();
  if (!place) throw new Error("no end");
  await page.mouse.move(place.x + place.width / 2, place.y + place.height / 2);
  await page.mouse.down();
  await page.mouse.move(place.x + place.width / 2 + 20, place.y + place.height / 2 + 5, { steps: 4 });
  await page.mouse.up();
  await expect(end).not.toHaveAttribute("aria-label", name ?? "");
  await page.getByRole("button", { name: "Add a match" }).click();
  const added = page.getByRole("button", { name: new RegExp(`^Match ${before.length}, right end`) });
  await added.press("ArrowRight");
  await expect(added).toHaveAttribute("aria-label", /column 484/);
  await accessible(page, "matches changed");

  await page.getByRole("button", { name: "Run again with these matches" }).click();
  await expect(page).not.toHaveURL(new RegExp(id));
  await expect(page.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  const now = (await pair(idOf(page))).matches;
  expect(now.length).toBe(before.length);
  expect(now.some((one) => one.right[0] === 484 && one.left[0] === 480)).toBe(true);
  await expect(page.getByRole("button", { name: /^Match 1, left end/ })).toBeVisible();
  await narrow(page, "matches");
  const second = JSON.stringify(before[1]?.left);
  expect(now.some((one) => JSON.stringify(one.left) === second)).toBe(false);
  expect(errors).toEqual([]);
});
