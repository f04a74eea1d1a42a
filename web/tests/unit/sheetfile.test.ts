import { describe, expect, it } from "vitest";
import { type Schema, groupsOf, strangersOf } from "../../src/lib/options";
import { documentOf, figureOf, hasMatches, hasTruth, viewsOfSheet } from "../../src/lib/sheetfile";

const file = (name: string) => new File(["x"], name);
const files = ["a.png", "b.png", "m.png"].map(file);
const sheet = {
  name: "hero",
  elevation_deg: 0,
  views: [
    { image: "drawn/a.png", azimuth_deg: 0, axis_x: 12, erase: [[[0, 0], [1, 0], [1, 1]]] },
    { image: "b.png", azimuth_deg: -90, mask: "m.png", mask_with_outline: true, mirrored: true, scale: 2 },
  ],
  holes: [
    { azimuth_deg: 270, x: 3, y: 4 },
    { azimuth_deg: 33, x: 5, y: 6 },
  ],
};

describe("a sheet document with its drawings", () => {
  it("says what is known of each", () => {
    expect(viewsOfSheet(sheet, files)).toMatchObject([
      { file: { name: "a.png" }, azimuth: 0, elevation: 0, mirrored: false },
      { file: { name: "b.png" }, mask: { name: "m.png" }, azimuth: 270, mirrored: true },
    ]);
    expect(viewsOfSheet({ ...sheet, elevation_deg: 20 }, files)?.[0]?.elevation).toBe(20);
  });

  it("is for the service to judge where it is none, or lacks a file", () => {
    for (const odd of [null, 3, {}, { views: {} }, { views: [] }, { views: [null] }, { views: [{ image: "a.png" }] }]) {
      expect(viewsOfSheet(odd, files)).toBeNull();
    }
    expect(viewsOfSheet(sheet, files.slice(0, 1))).toBeNull();
    expect(viewsOfSheet(sheet, files.slice(0, 2))).toBeNull();
  });

  it("becomes figures that are whole pictures", () => {
    const [a, b] = viewsOfSheet(sheet, files) ?? [];
    if (!a || !b) throw new Error("no views");
    const size = { width: 30, height: 20 };
    const box = { left: 0, top: 0, right: 30, bottom: 20 };
    expect(figureOf(a, 0, size, sheet)).toMatchObject({ picture: 0, box, axis_x: 12, erase: sheet.views[0]?.erase, holes: [] });
    expect(figureOf(b, 1, size, sheet)).toMatchObject({
      azimuth_deg: 270,
      mirrored: true,
      scale_by_hand: 2,
      mask_with_outline: true,
      holes: [[3, 4]],
    });
  });

  it("keeps what it says when angles are changed, and holes go along", () => {
    const views = viewsOfSheet(sheet, files) ?? [];
    const changed = views.map((view) => (view.azimuth === 270 ? { ...view, azimuth: 90 } : view));
    const made = documentOf(changed, { seed: 1 }, (at) => `${at}.png`, sheet);
    expect(made).toMatchObject({
      name: "hero",
      options: { seed: 1 },
      views: [{ image: "0.png", axis_x: 12 }, { image: "1.png", azimuth_deg: 90, mask: "m.png", scale: 2 }],
      holes: [{ azimuth_deg: 90, x: 3, y: 4 }, { azimuth_deg: 33, x: 5, y: 6 }],
    });
    // Without its view a hole is nowhere; one that was never in a view is the service's to judge.
    expect(documentOf(views.slice(0, 1), {}, String, sheet).holes).toEqual([{ azimuth_deg: 33, x: 5, y: 6 }]);
  });

  it("tells what a page has no place for", () => {
    expect([hasTruth(sheet), hasMatches(sheet)]).toEqual([false, false]);
    expect(hasTruth({ ...sheet, truth: { model: "t.obj" } })).toBe(true);
    expect(hasTruth({ views: [{ image: "a.png", azimuth_deg: 0, depth: "d.png" }] })).toBe(true);
  });
});

describe("options that the form has no field for", () => {
  it("are told by their names", () => {
    const schema: Schema = { properties: { seed: { type: "integer" }, area: { type: ["object", "null"] } } };
    const options = { seed: 2, sead: 3, area: { x: 1 }, deep: { er: true } };
    expect(strangersOf(groupsOf(schema), options)).toEqual({ sead: 3, "deep.er": true });
  });
});
