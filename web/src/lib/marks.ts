// What is marked on a figure by hand: points and areas, px of its picture.

import type { PixelBox } from "./boxes";

export type Point = [x: number, y: number];

/** What a click on the picture does. */
export type Tool = "boxes" | "attach" | "ignore" | "hole" | "erase" | "polygon";

/** Tools whose clicks are corners of an area. */
export const isArea = (tool: Tool) => tool === "erase" || tool === "polygon";

/** The marks of a figure, as the service names them. */
export interface Marks {
  attach: number[][];
  ignore: number[][];
  holes: number[][];
  erase: number[][][];
  polygon: number[][];
}

/** One mark that can be taken away again. */
export interface Mark {
  kind: "attach" | "ignore" | "hole" | "erase" | "polygon";
  /** From 0 among those of its kind. */
  at: number;
}

const rounded = ([x, y]: Point): Point => [Math.round(x * 10) / 10, Math.round(y * 10) / 10];

const clamp = (value: number, low: number, high: number) => Math.min(high, Math.max(low, value));

/** The point on the picture, to a tenth of a pixel. */
export function onPicture([x, y]: Point, width: number, height: number): Point {
  return rounded([clamp(x, 0, width), clamp(y, 0, height)]);
}

/** The point in the box. */
export function inBox([x, y]: Point, box: PixelBox): Point {
  return rounded([clamp(x, box.left, box.right), clamp(y, box.top, box.bottom)]);
}

/** What a point of a tool that marks points changes. */
export function withPoint(marks: Marks, tool: Tool, point: Point): Partial<Marks> {
  if (tool === "attach") return { attach: [...marks.attach, point] };
  if (tool === "ignore") return { ignore: [...marks.ignore, point] };
  if (tool === "hole") return { holes: [...marks.holes, point] };
  return {};
}

/** What a closed area changes; of fewer than three corners it is none. */
export function withArea(marks: Marks, tool: Tool, corners: Point[]): Partial<Marks> {
  if (corners.length < 3) return {};
  if (tool === "erase") return { erase: [...marks.erase, corners] };
  if (tool === "polygon") return { polygon: corners };
  return {};
}

/** All marks, in the order in which they are listed. */
export function listed(marks: Marks): Mark[] {
  const of = (kind: Mark["kind"], list: unknown[]) => list.map((_, at): Mark => ({ kind, at }));
  return [
    ...of("polygon", marks.polygon.length > 0 ? [0] : []),
    ...of("erase", marks.erase),
    ...of("attach", marks.attach),
    ...of("ignore", marks.ignore),
    ...of("hole", marks.holes),
  ];
}

/** What it changes when a mark is taken away. */
export function without(marks: Marks, { kind, at }: Mark): Partial<Marks> {
  const left = <T>(list: T[]) => list.filter((_, index) => index !== at);
  switch (kind) {
    case "polygon":
      return { polygon: [] };
    case "erase":
      return { erase: left(marks.erase) };
    case "attach":
      return { attach: left(marks.attach) };
    case "ignore":
      return { ignore: left(marks.ignore) };
    case "hole":
      return { holes: left(marks.holes) };
  }
}
