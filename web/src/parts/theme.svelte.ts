// Dark or light: as the system has it until a person says otherwise.

const SLOT = "turnaround-theme";
const dark = matchMedia("(prefers-color-scheme: dark)");

class Theme {
  chosen = $state<"dark" | "light" | null>(read());
  #system = $state(dark.matches);

  constructor() {
    dark.addEventListener("change", () => (this.#system = dark.matches));
    this.#apply();
  }

  get value(): "dark" | "light" {
    return this.chosen ?? (this.#system ? "dark" : "light");
  }

  toggle(): void {
    this.chosen = this.value === "dark" ? "light" : "dark";
    localStorage.setItem(SLOT, this.chosen);
    this.#apply();
  }

  #apply(): void {
    if (this.chosen) document.documentElement.dataset["theme"] = this.chosen;
  }
}

function read(): "dark" | "light" | null {
  const kept = localStorage.getItem(SLOT);
  return kept === "dark" || kept === "light" ? kept : null;
}

export const theme = new Theme();

/** The stage's colours, from the style sheet. */
export function colours() {
  const style = getComputedStyle(document.documentElement);
  const of = (name: string) => style.getPropertyValue(name).trim();
  return { background: of("--stage"), grid: of("--stage-grid"), accent: of("--accent") };
}
