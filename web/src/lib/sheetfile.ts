// A sheet document that came with its drawings: what it says of each of them, as
// the figures of a page say it, and the same document with what was changed.

import type { FigureEdit, SheetDocument } from "../api/types";
import { turned } from "./azimuth";
import { last } from "./drop";

/** A document as it is written: nothing of it has to be there. */
export type SheetFile = Partial<Omit<SheetDocument, "options">> & { options?: Record<string, unknown> };
type ViewDocument = SheetDocument["views"][number];

/** A drawing as it is looked at before it is sent. */
export interface SheetView {
  file: File;
  azimuth: number;
  elevation: number;
  mirrored: boolean;
  /** Its mask's file. */
  mask?: File;
  /** What the document says of it. */
  given?: ViewDocument;
}

/** What was dropped as drawings: with a document, or files alone. */
export interface DroppedViews {
  files: File[];
  sheet?: { document: SheetFile; views: SheetView[] };
}

/** The views of a document with their files; null if it is for the service to say what is wrong
    with it, or to fetch what it names. */
export function viewsOfSheet(document: unknown, files: File[]): SheetView[] | null {
  const sheet = document as SheetFile | null;
  if (typeof sheet !== "object" || sheet === null || !Array.isArray(sheet.views)) return null;
  const file = (name: unknown) =>
    typeof name === "string" ? files.find((one) => last(one.name) === last(name)) : undefined;
  const views: SheetView[] = [];
  for (const given of sheet.views) {
    const [drawing, mask] = [file(given?.image), file(given?.mask)];
    if (!drawing || !Number.isFinite(given.azimuth_deg) || (given.mask && !mask)) return null;
    views.push({
      file: drawing,
      azimuth: turned(given.azimuth_deg),
      elevation: given.elevation_deg ?? sheet.elevation_deg ?? 0,
      mirrored: given.mirrored ?? false,
      ...(mask ? { mask } : {}),
      given,
    });
  }
  return views.length > 0 ? views : null;
}

/** The holes that the document points at in a view. */
function holesOf(given: ViewDocument, sheet: SheetFile): NonNullable<SheetDocument["holes"]> {
  const [azimuth, elevation] = [turned(given.azimuth_deg), given.elevation_deg ?? sheet.elevation_deg ?? 0];
  return (sheet.holes ?? []).filter(
    (hole) => turned(hole.azimuth_deg) === azimuth && (hole.elevation_deg ?? 0) === elevation,
  );
}

/** A view as a figure that is a whole picture. */
export function figureOf(
  view: SheetView,
  picture: number,
  { width, height }: { width: number; height: number },
  sheet: SheetFile = {},
): FigureEdit {
  const { azimuth, elevation, mirrored, mask, given } = view;
  return {
    picture,
    box: { left: 0, top: 0, right: width, bottom: height },
    azimuth_deg: azimuth,
    elevation_deg: elevation,
    kept: true,
    mirrored,
    polygon: given?.polygon ?? [],
    erase: given?.erase ?? [],
    attach: given?.attach ?? [],
    ignore: given?.ignore ?? [],
    axis_x: given?.axis_x ?? null,
    ground_y: given?.ground_y ?? null,
    scale_by_hand: given?.scale ?? null,
    holes: given ? holesOf(given, sheet).map(({ x, y }) => [x, y]) : [],
    mask_with_outline: mask !== undefined && (given?.mask_with_outline ?? false),
  };
}

/** The document with the angles and options as they are now; `sheet` is what came, if one did.
    Drawings are called as `nameOf` says. */
export function documentOf(
  views: SheetView[],
  options: Record<string, unknown>,
  nameOf: (at: number) => string,
  sheet: SheetFile = {},
): SheetFile {
  const document: SheetFile = {
    ...sheet,
    views: views.map((view, at) => ({
      ...view.given,
      image: nameOf(at),
      azimuth_deg: view.azimuth,
      elevation_deg: view.elevation,
      mirrored: view.mirrored,
    })),
    options,
  };
  // Holes go where their view went, and with it.
  if (sheet.holes) {
    const moved = new Map((sheet.views ?? []).flatMap((given) => {
      const view = views.find((one) => one.given?.image === given.image);
      return holesOf(given, sheet).map((hole) => [hole, view] as const);
    }));
    document.holes = sheet.holes.flatMap((hole) => {
      if (!moved.has(hole)) return [hole];
      const view = moved.get(hole);
      if (!view) return [];
      const elevation = view.elevation === 0 ? {} : { elevation_deg: view.elevation };
      return [{ x: hole.x, y: hole.y, azimuth_deg: view.azimuth, ...elevation }];
    });
  }
  return document;
}

/** Whether there is something to measure against, which a page has no place for. */
export const hasTruth = (sheet: SheetFile) =>
  Boolean(sheet.truth?.model) || (sheet.views ?? []).some((view) => view.depth || view.disparity);

/** Whether matches by hand come along, which a page has no place for. */
export const hasMatches = (sheet: SheetFile) => (sheet.matches ?? []).length > 0;
