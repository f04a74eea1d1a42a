// Matches of a pair of views, corrected by hand and sent back.

export type Point = [x: number, y: number];
export type End = "left" | "right";

export interface Match {
  left: Point;
  right: Point;
  /** Whether it agrees with the epipolar geometry; nothing is known of those by hand. */
  inlier?: boolean | null;
}

/** As the artifact `pairs/A-B/matches.json` has it. */
export interface PairMatches {
  left_azimuth_deg: number;
  right_azimuth_deg: number;
  frame?: string;
  matches: Match[];
}

/** A pair as its artifacts are named. */
export interface Pair {
  /** Such as `0-45`. */
  name: string;
  left: number;
  right: number;
}

export interface Size {
  width: number;
  height: number;
}

/** The pairs whose matches are among these artifacts. */
export function pairsOf(names: Iterable<string>): Pair[] {
  const pairs: Pair[] = [];
  for (const name of names) {
    const found = /^pairs\/(([\d.]+)-([\d.]+))\/matches\.json$/.exec(name);
    if (found) pairs.push({ name: found[1] ?? "", left: Number(found[2]), right: Number(found[3]) });
  }
  return pairs.sort((a, b) => a.left - b.left);
}

const clamp = (value: number, most: number) => Math.min(most, Math.max(0, value));
const tenth = (value: number) => Math.round(value * 10) / 10;

/** The matches with one end moved to a place in its view. */
export function moved(matches: Match[], at: number, end: End, [x, y]: Point, size: Size): Match[] {
  const place: Point = [tenth(clamp(x, size.width)), tenth(clamp(y, size.height))];
  return matches.map((match, index) =>
    index === at ? { left: match.left, right: match.right, [end]: place } : match,
  );
}

/** The matches with one more, in the middle of both views. */
export function added(matches: Match[], size: Size): Match[] {
  const middle: Point = [tenth(size.width / 2), tenth(size.height / 2)];
  return [...matches, { left: middle, right: middle }];
}

/** The matches without one. */
export function removed(matches: Match[], at: number): Match[] {
  return matches.filter((_, index) => index !== at);
}

/** What is sent back of a pair: places alone, in place of the automatic matches. */
export function documentOf(pair: PairMatches, matches: Match[]): PairMatches {
  const { left_azimuth_deg, right_azimuth_deg, frame } = pair;
  return {
    left_azimuth_deg,
    right_azimuth_deg,
    ...(frame === undefined ? {} : { frame }),
    matches: matches.map(({ left, right }) => ({ left, right })),
  };
}

/** The match nearest to a place of the pair's picture, the right view beside the left one. */
export function nearest(matches: Match[], [x, y]: Point, size: Size): number {
  let best = -1;
  let least = Infinity;
  for (const [at, { left, right }] of matches.entries()) {
    const apart = Math.min(
      Math.hypot(left[0] - x, left[1] - y),
      Math.hypot(right[0] + size.width - x, right[1] - y),
    );
    if (apart < least) [best, least] = [at, apart];
  }
  return best;
}
