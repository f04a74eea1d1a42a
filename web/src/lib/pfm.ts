// Float maps (PFM): rows from below, little endian where the scale is negative.

export interface FloatMap {
  width: number;
  height: number;
  /** From the top, row by row; not finite where nothing is known. */
  values: Float32Array;
  min: number;
  max: number;
}

export function readPfm(bytes: ArrayBuffer): FloatMap {
  const head = new TextDecoder("latin1").decode(bytes.slice(0, 64));
  const found = /^Pf\s+(\d+)\s+(\d+)\s+(-?[\d.eE+]+)\s/.exec(head);
  if (!found) throw new Error("not a grey PFM file");
  const width = Number(found[1]);
  const height = Number(found[2]);
  const little = Number(found[3]) < 0;
  const view = new DataView(bytes, found[0].length);
  if (view.byteLength < width * height * 4) throw new Error("the PFM file ends early");
  const values = new Float32Array(width * height);
  let min = Infinity;
  let max = -Infinity;
  for (let y = 0; y < height; y += 1) {
    for (let x = 0; x < width; x += 1) {
      const value = view.getFloat32(((height - 1 - y) * width + x) * 4, little);
      values[y * width + x] = value;
      if (Number.isFinite(value)) {
        min = Math.min(min, value);
        max = Math.max(max, value);
      }
    }
  }
  return { width, height, values, min, max };
}

const STOPS = [
  [48, 18, 59],
  [70, 107, 227],
  [40, 187, 236],
  [49, 242, 153],
  [162, 252, 60],
  [237, 208, 58],
  [251, 128, 34],
  [210, 49, 5],
  [122, 4, 3],
] as const;

/** A colour of the Turbo map for a share from 0 to 1. */
export function turbo(share: number): [number, number, number] {
  const at = Math.min(1, Math.max(0, share)) * (STOPS.length - 1);
  const k = Math.min(STOPS.length - 2, Math.floor(at));
  const [a, b] = [STOPS[k] ?? STOPS[0], STOPS[k + 1] ?? STOPS[0]];
  const mix = (i: 0 | 1 | 2) => Math.round(a[i] + (b[i] - a[i]) * (at - k));
  return [mix(0), mix(1), mix(2)];
}
