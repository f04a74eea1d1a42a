// Angles as people name them.

/** In [0, 360). */
export function turned(degrees: number): number {
  const rest = degrees % 360;
  return rest < 0 ? rest + 360 : rest === 0 ? 0 : rest;
}

/** As the service writes it in names: `45`, `22.5`. */
export function azimuthName(degrees: number): string {
  return String(Number(turned(degrees).toFixed(6)));
}

export const NAMED = [0, 45, 90, 135, 180, 225, 270, 315] as const;

/** The nearest eighth of a turn. */
export function nearestNamed(degrees: number): number {
  return turned(Math.round(turned(degrees) / 45) * 45);
}

/** The angle of the same view drawn facing the other way. */
export function otherWay(degrees: number): number {
  return turned(360 - turned(degrees));
}

const WORDS: [RegExp, number][] = [
  [/(3-?4|three-?quarter|quarter).*back|back.*(3-?4|quarter)/, 135],
  [/3-?4|three-?quarter|quarter/, 45],
  [/front/, 0],
  [/back|rear/, 180],
  [/right/, 270],
  [/left|side|profile/, 90],
];

/** The angle that a file's name tells: `view_045.png`, `front.png`; or null. */
export function azimuthOfName(name: string): number | null {
  const stem = name.toLowerCase().replace(/\.[a-z0-9]+$/, "");
  for (const [words, degrees] of WORDS) if (words.test(stem)) return degrees;
  const numbers = [...stem.matchAll(/(?<![0-9.])-?\d{1,3}(?:\.\d+)?(?![0-9])/g)];
  const last = numbers.at(-1);
  return last ? turned(Number(last[0].replace(/^-(?=0\d)/, ""))) : null;
}

/** Angles for so many views whose names tell none: evenly round. */
export function spread(count: number): number[] {
  if (count === 2) return [0, 90];
  if (count === 3) return [0, 45, 90];
  return Array.from({ length: count }, (_, k) => (360 / count) * k);
}

/** A guess for each file, all different. */
export function guessAzimuths(names: string[]): number[] {
  const told = names.map(azimuthOfName);
  const all = told.every((angle) => angle !== null);
  if (all && new Set(told).size === told.length) return told as number[];
  return spread(names.length);
}
