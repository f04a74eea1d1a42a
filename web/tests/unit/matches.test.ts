import { describe, expect, it } from "vitest";
import { type Match, added, documentOf, moved, nearest, pairsOf, removed } from "../../src/lib/matches";

const size = { width: 100, height: 60 };
const matches: Match[] = [
  { left: [10, 10], right: [12, 10], inlier: true },
  { left: [50, 30], right: [55, 31], inlier: false },
];

describe("matches of a pair", () => {
  it("are found among the artifacts", () => {
    const names = ["pairs/315-0/matches.json", "pairs/0-22.5/matches.json", "pairs/0-22.5/matches.png", "hull.glb"];
    expect(pairsOf(names)).toEqual([
      { name: "0-22.5", left: 0, right: 22.5 },
      { name: "315-0", left: 315, right: 0 },
    ]);
  });

  it("are moved within their view, and are then by hand", () => {
    const now = moved(matches, 1, "right", [140, -3], size);
    expect(now[1]).toEqual({ left: [50, 30], right: [100, 0] });
    expect(now[0]).toBe(matches[0]);
    expect(moved(matches, 0, "left", [1.26, 2], size)[0]?.left).toEqual([1.3, 2]);
  });

  it("come and go", () => {
    expect(added(matches, size).at(-1)).toEqual({ left: [50, 30], right: [50, 30] });
    expect(removed(matches, 0)).toEqual([matches[1]]);
  });

  it("are sent back as places alone, in place of the automatic ones", () => {
    const told = { left_azimuth_deg: 0, right_azimuth_deg: 5, frame: "sheet pixels", matches };
    expect(documentOf(told, removed(matches, 1))).toEqual({
      left_azimuth_deg: 0,
      right_azimuth_deg: 5,
      frame: "sheet pixels",
      matches: [{ left: [10, 10], right: [12, 10] }],
    });
    expect(documentOf(told, [])).toMatchObject({ matches: [] });
  });

  it("are chosen by the nearer end, the right view beside the left", () => {
    expect(nearest(matches, [11, 12], size)).toBe(0);
    expect(nearest(matches, [154, 30], size)).toBe(1);
    expect(nearest([], [0, 0], size)).toBe(-1);
  });
});
