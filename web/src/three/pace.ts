// Fewer pixels while it moves on a slow machine, all of them at rest.

/** Whether 3D is drawn by the processor: smooth edges cost too much there. */
export function isSoftware(): boolean {
  const probe = document.createElement("canvas").getContext("webgl");
  const info = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = info ? String(probe?.getParameter(info.UNMASKED_RENDERER_WEBGL)) : "";
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class Pace {
  /** Share of the full resolution. */
  sharpness = 1;
  #slow = 0;
  #rest = 0;

  /** @param onchange Told when the sharpness is another one. */
  constructor(private readonly onchange: () => void) {}

  /** A frame is drawn, so many ms after the last one. */
  frame(passed: number): void {
    if (passed < 250) this.#slow = passed > 45 ? this.#slow + 1 : Math.max(0, this.#slow - 1);
    if (this.#slow >= 4 && this.sharpness > 0.5) {
      this.sharpness -= 0.25;
      this.#slow = 0;
      this.onchange();
    }
    clearTimeout(this.#rest);
    if (this.sharpness < 1) {
      this.#rest = window.setTimeout(() => {
        this.sharpness = 1;
        this.onchange();
      }, 300);
    }
  }

  dispose(): void {
    clearTimeout(this.#rest);
  }
}
