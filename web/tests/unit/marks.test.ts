import { describe, expect, it } from "vitest";
import { levelOf, newFigure, twins } from "../../src/lib/figure";
import { named, nameOf } from "../../src/lib/drop";
import { type Marks, inBox, listed, onPicture, withArea, withPoint, without } from "../../src/lib/marks";

const none: Marks = { attach: [], ignore: [], holes: [], erase: [], polygon: [] };
const triangle: [number, number][] = [[0, 0], [9, 0], [0, 9]];

describe("marks of a figure", () => {
  it("are points or areas, by tool", () => {
    expect(withPoint(none, "attach", [1, 2])).toEqual({ attach: [[1, 2]] });
    expect(withPoint({ ...none, holes: [[5, 5]] }, "hole", [1, 2])).toEqual({ holes: [[5, 5], [1, 2]] });
    expect(withPoint(none, "boxes", [1, 2])).toEqual({});
    expect(withArea(none, "erase", triangle)).toEqual({ erase: [triangle] });
    // An outline by hand is one; the next takes its place.
    expect(withArea({ ...none, polygon: [[1, 1]] }, "polygon", triangle)).toEqual({ polygon: triangle });
    expect(withArea(none, "erase", triangle.slice(0, 2))).toEqual({});
  });

  it("are listed and taken away one by one", () => {
    const marks = { ...none, attach: [[1, 2], [3, 4]], erase: [triangle], polygon: triangle };
    expect(listed(marks)).toEqual([
      { kind: "polygon", at: 0 },
      { kind: "erase", at: 0 },
      { kind: "attach", at: 0 },
      { kind: "attach", at: 1 },
    ]);
    expect(without(marks, { kind: "attach", at: 0 })).toEqual({ attach: [[3, 4]] });
    expect(without(marks, { kind: "polygon", at: 0 })).toEqual({ polygon: [] });
    expect(without({ ...marks, holes: [[5, 6]] }, { kind: "hole", at: 0 })).toEqual({ holes: [] });
  });

  it("stay where the service takes them", () => {
    expect(onPicture([-3, 12.345], 100, 10)).toEqual([0, 10]);
    expect(onPicture([3.14159, 2], 100, 10)).toEqual([3.1, 2]);
    expect(inBox([0, 99], { left: 5, top: 5, right: 20, bottom: 30 })).toEqual([5, 30]);
  });
});

describe("views that cannot be used together", () => {
  const at = (azimuth_deg: number, elevation_deg = 0, kept = true) => ({ azimuth_deg, elevation_deg, kept });

  it("are at one azimuth and elevation", () => {
    expect(twins([at(0), at(90), at(360)])).toEqual([0, 2]);
    expect(twins([at(0), at(0, 90), at(90)])).toBeNull();
    expect(twins([at(0), at(0, 0, false)])).toBeNull();
    expect(levelOf([at(0), at(0, 90), at(45, -10)])).toBe(1);
  });

  it("a new figure is at none of the angles that are taken", () => {
    const size = { width: 100, height: 100 };
    const first = newFigure([], 0, size);
    const second = newFigure([first], 0, size);
    expect([first.azimuth_deg, second.azimuth_deg]).toEqual([0, 90]);
    expect(newFigure([{ ...first, kept: false }], 1, size)).toMatchObject({ azimuth_deg: 0, picture: 1 });
  });
});

describe("the name of a page", () => {
  it("is that of its file, within what the service takes", () => {
    expect([named("v1/pages", "a b.png"), named("v1/pages", null)]).toEqual(["v1/pages?name=a+b.png", "v1/pages"]);
    expect(nameOf("folder/ida turn.png")).toBe("ida turn.png");
    expect(nameOf("a\u0007b\n.png")).toBe("a b .png");
    expect(new TextEncoder().encode(nameOf("𝕏".repeat(300))).length).toBe(200);
  });
});
