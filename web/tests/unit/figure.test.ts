import { describe, expect, it } from "vitest";
import type { Page } from "../../src/api/types";
import { modelsOf } from "../../src/lib/draft";
import { newFigure, unusedOf } from "../../src/lib/figure";

describe("what is left out of a page", () => {
  const picture = { width: 100, height: 80, paper: [255, 255, 255], picture: "", preview: "" };
  const left = (number: number) => ({ picture: number, kind: "caption", box: { left: 0, top: 0, right: 9, bottom: 9 }, why: "" });
  const page = (box: Page["figures"][number]["box"]) =>
    ({
      pictures: [picture, picture],
      figures: [{ ...newFigure([], 1, picture), box }],
      left_out: [left(0), left(1)],
    }) as unknown as Page;

  it("is told, but not of a picture that is a figure as a whole", () => {
    expect(unusedOf(page({ left: 0, top: 0, right: 100, bottom: 80 }))).toEqual([left(0)]);
    expect(unusedOf(page({ left: 0, top: 0, right: 100, bottom: 79 }))).toEqual([left(0), left(1)]);
  });
});

describe("models of a draft", () => {
  it("are those of its method", () => {
    const path = "v1/reconstructions/ID";
    const turntable = modelsOf(path, new Set(["solid.glb", "textured.glb"]));
    expect(turntable).toMatchObject({ solid: `${path}/artifacts/solid.glb`, textured: `${path}/artifacts/textured.glb` });
    expect(turntable?.silhouette({ azimuth: -315, elevation: 90 })).toBe(`${path}/artifacts/views/45_e90/silhouette.png`);
    expect(modelsOf(path, new Set(["hull.glb"]))).toMatchObject({ solid: `${path}/artifacts/hull.glb`, textured: null });
    expect(modelsOf(path, new Set(["metrics.json"]))).toBeNull();
  });
});
