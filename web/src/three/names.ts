import { azimuthName } from "../lib/azimuth";

/**
 * The name of the plane with the drawing of an azimuth: `ref_045` in the file.
 * The reader of glTF leaves dots out: `ref_022.5` is `ref_0225` here.
 */
export function planeName(azimuth: number): string {
  const [whole = "0", rest = ""] = azimuthName(azimuth).split(".");
  return `ref_${whole.padStart(3, "0")}${rest}`;
}
