// Numbers in plain words, the worst first.

import { fill, text } from "../text";
import type { Reconstruction } from "../api/types";
import { type Viewpoint, viewpointOf, viewpointWords } from "./viewpoint";

export type Grade = "good" | "fair" | "poor";

export interface ViewFit {
  view: Viewpoint;
  grade: Grade;
  /** Share of outlines that overlap. */
  overlap: number;
  words: string;
}

/** How well a draft covers a drawing, as a person would say. */
export function gradeOf(silhouetteIou: number): Grade {
  if (silhouetteIou >= 0.95) return "good";
  return silhouetteIou >= 0.88 ? "fair" : "poor";
}

export function fitsOf(job: Reconstruction): ViewFit[] {
  return (job.summary?.fit ?? []).map((fit) => {
    const view = viewpointOf(fit);
    const grade = gradeOf(fit.silhouette_iou);
    const values = {
      view: viewpointWords(view),
      overlap: percent(fit.silhouette_iou),
      distance: fit.outline_distance_px?.toFixed(1) ?? "–",
    };
    const words = fill(text.fit[grade], values);
    return { view, grade, overlap: fit.silhouette_iou, words };
  });
}

/** One sentence about all views. */
export function verdict(fits: ViewFit[]): { grade: Grade; words: string } | null {
  if (fits.length === 0) return null;
  const poor = fits.filter((fit) => fit.grade === "poor");
  const names = (some: ViewFit[]) => some.map((fit) => viewpointWords(fit.view)).join(", ");
  if (poor.length > 0) {
    const words = poor.length === 1 ? text.fit.onePoor : text.fit.somePoor;
    return { grade: "poor", words: fill(words, { views: names(poor) }) };
  }
  const fair = fits.filter((fit) => fit.grade === "fair");
  if (fair.length > 0) {
    return { grade: "fair", words: fill(text.fit.someFair, { views: names(fair) }) };
  }
  return { grade: "good", words: fill(text.fit.allGood, { count: String(fits.length) }) };
}

export function percent(share: number): string {
  // Only what is whole is called so.
  const rounded = share < 1 ? Math.min(99, Math.round(share * 100)) : 100;
  return `${rounded} %`;
}

export function bytes(count: number): string {
  if (count < 1024) return `${count} B`;
  if (count < 1024 * 1024) return `${(count / 1024).toFixed(0)} KiB`;
  return `${(count / 1024 / 1024).toFixed(1)} MiB`;
}

export function seconds(from: string, to: string): string {
  const passed = (Date.parse(to) - Date.parse(from)) / 1000;
  return passed < 90 ? `${passed.toFixed(1)} s` : `${Math.round(passed / 60)} min`;
}
