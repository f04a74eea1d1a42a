// Boxes on a page, moved and resized by pointer or keys.

export interface PixelBox {
  left: number;
  top: number;
  right: number;
  bottom: number;
}

export type Corner = "nw" | "ne" | "sw" | "se";

/** A box of less than this cannot hold a figure, px. */
const LEAST = 16;

const clamp = (value: number, low: number, high: number) => Math.min(high, Math.max(low, value));

/** The box moved by so much, kept on the picture. */
export function moved(box: PixelBox, dx: number, dy: number, width: number, height: number): PixelBox {
  const x = Math.round(clamp(dx, -box.left, width - box.right));
  const y = Math.round(clamp(dy, -box.top, height - box.bottom));
  return { left: box.left + x, top: box.top + y, right: box.right + x, bottom: box.bottom + y };
}

/** The box with one corner moved, never smaller than a figure and never outside. */
export function resized(
  box: PixelBox,
  corner: Corner,
  dx: number,
  dy: number,
  width: number,
  height: number,
): PixelBox {
  const out = { ...box };
  if (corner.includes("w")) out.left = Math.round(clamp(box.left + dx, 0, box.right - LEAST));
  else out.right = Math.round(clamp(box.right + dx, box.left + LEAST, width));
  if (corner.includes("n")) out.top = Math.round(clamp(box.top + dy, 0, box.bottom - LEAST));
  else out.bottom = Math.round(clamp(box.bottom + dy, box.top + LEAST, height));
  return out;
}

/** A new box in the middle of the picture. */
export function fresh(width: number, height: number): PixelBox {
  return {
    left: Math.round(width * 0.4),
    top: Math.round(height * 0.2),
    right: Math.round(width * 0.6),
    bottom: Math.round(height * 0.8),
  };
}
