// The API key: asked for once when the service wants one, kept for this tab.

const SLOT = "turnaround-key";

class Key {
  value = $state<string | null>(sessionStorage.getItem(SLOT));
  /** Whether a person is being asked. */
  asking = $state(false);
  /** Whether the key that was tried is wrong. */
  refused = $state(false);
  #waiting: (() => void)[] = [];

  /** Resolves once there is a key other than `tried`. */
  ask(tried: string | null): Promise<void> {
    if (this.value !== tried) return Promise.resolve();
    this.refused = tried !== null;
    this.asking = true;
    return new Promise((resolve) => this.#waiting.push(resolve));
  }

  /** Takes the key that a person gave. */
  give(value: string): void {
    this.value = value;
    sessionStorage.setItem(SLOT, value);
    this.asking = false;
    this.#waiting.splice(0).forEach((go) => go());
  }

  /** Forgets it. */
  forget(): void {
    this.value = null;
    this.refused = false;
    sessionStorage.removeItem(SLOT);
  }
}

export const key = new Key();
