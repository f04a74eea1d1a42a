// Masks as colours: white inside, on black.

/** A picture in one colour where the mask is inside, or where it is outside; clear elsewhere. */
export function shaded(
  mask: ImageBitmap | HTMLCanvasElement,
  [red, green, blue, alpha]: readonly [number, number, number, number],
  inside = true,
): OffscreenCanvas {
  const canvas = new OffscreenCanvas(mask.width, mask.height);
  const context = canvas.getContext("2d") as OffscreenCanvasRenderingContext2D;
  context.drawImage(mask, 0, 0);
  const picture = context.getImageData(0, 0, mask.width, mask.height);
  for (let k = 0; k < picture.data.length; k += 4) {
    const shown = (picture.data[k] ?? 0) > 127 === inside;
    picture.data.set([red, green, blue, shown ? alpha : 0], k);
  }
  context.putImageData(picture, 0, 0);
  return canvas;
}
