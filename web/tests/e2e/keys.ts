// A walk through the page by the Tab key alone.
import { type Page, expect } from "@playwright/test";

/** A stop of the walk. */
interface Stop {
  /** Of the controls that are there, in document order; -1 is none of them. */
  number: number;
  words: string;
  /** Left, top, right and bottom in the document, px. */
  box: [number, number, number, number];
  /** Whether it is seen that it has the focus, and it itself. */
  marked: boolean;
  inSight: boolean;
  /** Places on a picture, not of the layout. */
  onPicture: boolean;
}

declare global {
  interface Window {
    controls: { node: Element; before: string }[];
  }
}

/** Goes through all that can be reached: every control once, none passed over, each seen to have
    the focus, downwards and to the right, and out at the end as well as back. */
export async function walk(page: Page, state: string): Promise<void> {
  const names = await page.evaluate(() => {
    const root = [...document.querySelectorAll("dialog")].find((dialog) => dialog.open) ?? document;
    (document.activeElement as HTMLElement | null)?.blur();
    const selector =
      "a[href], button, input, select, textarea, summary, [role=button], [role=slider], [role=application], [tabindex]";
    const isControl = (node: Element) =>
      !node.matches(":disabled, [tabindex='-1'], [type=hidden]") && node.checkVisibility({ visibilityProperty: true });
    window.controls = [...root.querySelectorAll(selector)]
      .filter(isControl)
      .map((node) => ({ node, before: JSON.stringify(looks(node)) }));
    return window.controls.map(({ node }) => wordsOf(node));

    function looks(node: Element) {
      const style = getComputedStyle(node);
      return [style.outlineStyle, style.outlineWidth, style.boxShadow, style.stroke, style.strokeOpacity];
    }
    function wordsOf(node: Element) {
      return `${node.localName} "${(node.getAttribute("aria-label") ?? node.textContent ?? "").trim().slice(0, 40)}"`;
    }
  });
  expect(names.length, `${state}: controls`).toBeGreaterThan(0);

  const stop = () =>
    page.evaluate((): Stop | null => {
      const node = document.activeElement;
      if (!node || node === document.body || node === document.documentElement) return null;
      const number = window.controls.findIndex((one) => one.node === node);
      const style = getComputedStyle(node);
      const looks = [style.outlineStyle, style.outlineWidth, style.boxShadow, style.stroke, style.strokeOpacity];
      const { left, top, right, bottom } = node.getBoundingClientRect();
      return {
        number,
        words: `${node.localName} "${(node.getAttribute("aria-label") ?? node.textContent ?? "").trim().slice(0, 40)}"`,
        box: [left + scrollX, top + scrollY, right + scrollX, bottom + scrollY],
        marked: node.matches(":focus-visible") && JSON.stringify(looks) !== window.controls[number]?.before,
        inSight: bottom > 0 && right > 0 && top < innerHeight && left < innerWidth,
        onPicture: node.closest("svg") !== null && node.localName !== "svg",
      };
    });

  await page.evaluate(() => (window.controls[0]?.node as HTMLElement).focus());
  // A key press makes the browser show the focus; going away and back is one.
  await page.keyboard.press("Shift");
  const stops: Stop[] = [];
  for (let presses = 0; presses <= names.length + 2; presses += 1) {
    if (presses > 0) await page.keyboard.press("Tab");
    const here = await stop();
    if (!here || (presses > 0 && here.number === 0)) break;
    stops.push(here);
  }
  const told = stops.map((one) => one.words);
  expect(stops.map((one) => one.number), `${state}: reached one after the other: ${told.join(", ")}; there: ${names.join(", ")}`).toEqual(
    names.map((_, number) => number),
  );
  for (const [at, one] of stops.entries()) {
    // The first was not reached by a key.
    if (at > 0) expect(one.marked, `${state}: the focus is seen on ${one.words}`).toBe(true);
    expect(one.inSight, `${state}: ${one.words} is in sight`).toBe(true);
    const before = stops[at - 1];
    if (!before || before.onPicture || one.onPicture) continue;
    const [left, top, right, bottom] = one.box;
    const [l, t, r, b] = before.box;
    const overlaps = Math.min(right, r) - Math.max(left, l) > 1;
    const isAbove = bottom <= t + 1 && overlaps;
    const isRow = Math.min(bottom, b) - Math.max(top, t) > 0.5 * Math.min(bottom - top, b - t);
    expect(isAbove || (isRow && right <= l + 1), `${state}: ${one.words} comes after ${before.words}`).toBe(false);
  }
  // And back.
  const [beforeLast, end] = [stops.at(-2), stops.at(-1)];
  if (!beforeLast || !end) return;
  await page.evaluate((number) => (window.controls[number]?.node as HTMLElement).focus(), end.number);
  await page.keyboard.press("Shift+Tab");
  expect((await stop())?.number, `${state}: back`).toBe(beforeLast.number);
}
