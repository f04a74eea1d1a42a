// Options that were chosen before a page was made, kept for it until the tab is closed.

const slotOf = (page: string) => `turnaround-options-${page}`;

/** Keeps the options for the page of this id. */
export function carry(page: string, options: Record<string, unknown>): void {
  if (Object.keys(options).length > 0) sessionStorage.setItem(slotOf(page), JSON.stringify(options));
  else sessionStorage.removeItem(slotOf(page));
}

/** Those that were kept for it, if any were. */
export function carried(page: string): Record<string, unknown> {
  return JSON.parse(sessionStorage.getItem(slotOf(page)) ?? "{}") as Record<string, unknown>;
}
