// Figures of a page: new ones, and those that cannot be used together.

import type { Page, PageFigure } from "../api/types";
import { turned } from "./azimuth";
import { fresh } from "./boxes";

/** The angle of a view, as far as it tells it from others. */
interface Angle {
  azimuth_deg: number;
  elevation_deg: number;
}

/** Whether two views would be one: the azimuth counts straight from above too. */
const isSame = (a: Angle, b: Angle) =>
  turned(a.azimuth_deg) === turned(b.azimuth_deg) && a.elevation_deg === b.elevation_deg;

/** Two views at one angle, by number from 0; the later one second. */
export function twins(angles: (Angle & { kept?: boolean })[]): [number, number] | null {
  for (const [b, angle] of angles.entries()) {
    if (angle.kept === false) continue;
    const a = angles.findIndex((one) => one.kept !== false && isSame(one, angle));
    if (a < b) return [a, b];
  }
  return null;
}

/** How many views are level: two of them are needed. */
export const levelOf = (angles: Angle[]) => angles.filter((angle) => angle.elevation_deg === 0).length;

/** What was found on the page and is not used. In a picture that is a figure as a whole the
    silhouette tells that, not what was found before. */
export function unusedOf({ figures, pictures, left_out: found }: Page): Page["left_out"] {
  const whole = figures
    .filter(({ box, picture: number }) => {
      const picture = pictures[number];
      const { left, top, right, bottom } = box;
      return left === 0 && top === 0 && right === picture?.width && bottom === picture.height;
    })
    .map((figure) => figure.picture);
  return found.filter((thing) => !whole.includes(thing.picture));
}

/** A figure in the middle of the picture, at an angle that none has yet. */
export function newFigure(
  figures: PageFigure[],
  picture: number,
  { width, height }: { width: number; height: number },
): PageFigure {
  const taken = new Set(figures.filter((one) => one.kept).map((one) => turned(one.azimuth_deg)));
  const box = fresh(width, height);
  return {
    picture,
    box,
    crop: box,
    azimuth_deg: [0, 90, 180, 45, 270, 135, 315, 225].find((degrees) => !taken.has(degrees)) ?? 10,
    elevation_deg: 0,
    confidence: 1,
    kept: true,
    mirrored: false,
    outline: [],
    polygon: [],
    erase: [],
    attach: [],
    ignore: [],
    axis_x: null,
    ground_y: null,
    scale_by_hand: null,
    holes: [],
    mask_given: false,
    mask_with_outline: false,
    baseline_row: box.bottom,
    axis_column: (box.left + box.right) / 2,
    facing: 0,
    scale: 1,
    row: 0,
    warnings: [],
    crop_picture: "",
    mask_picture: "",
  };
}
