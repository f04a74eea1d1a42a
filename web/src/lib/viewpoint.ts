// Where drawings look from, as the service names them and as people read it.

import { fill, text } from "../text";
import { azimuthName } from "./azimuth";

export interface Viewpoint {
  azimuth: number;
  /** Degrees above the ground; 0 is level. */
  elevation: number;
}

export function viewpointOf(view: { azimuth_deg: number; elevation_deg?: number | null }): Viewpoint {
  return { azimuth: view.azimuth_deg, elevation: view.elevation_deg ?? 0 };
}

const raised = ({ elevation }: Viewpoint) => (elevation === 0 ? "" : `_e${Number(elevation.toFixed(6))}`);

/** As in names of files: `45`, `0_e90`. */
export function viewpointName(view: Viewpoint): string {
  return azimuthName(view.azimuth) + raised(view);
}

/** `45°`, `0° raised 90°`. */
export function viewpointWords(view: Viewpoint): string {
  const degrees = String(Number(view.elevation.toFixed(6)));
  const words = view.elevation === 0 ? "" : ` ${fill(text.elevation.short, { degrees })}`;
  return `${azimuthName(view.azimuth)}°${words}`;
}

/**
 * The name of the plane with a drawing: `ref_045`, `ref_000_e90` in the file.
 * The reader of glTF leaves dots out: `ref_022.5` is `ref_0225` here.
 */
export function planeName(view: Viewpoint): string {
  const [whole = "0", rest = ""] = azimuthName(view.azimuth).split(".");
  return `ref_${whole.padStart(3, "0")}${rest}${raised(view).replace(".", "")}`;
}
