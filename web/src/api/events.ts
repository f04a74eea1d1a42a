// A job followed to its end: server-sent events over fetch, for EventSource sends
// no key; where they do not come through, the job is asked for again and again.

import { ApiError, ask, askJson } from "./client";
import type { AnyJob } from "./types";

/** One server-sent event. */
export interface SentEvent {
  id: string;
  event: string;
  data: string;
}

/** Reads events from text as it comes, in pieces of any size. */
export class EventReader {
  #rest = "";

  push(text: string): SentEvent[] {
    this.#rest += text;
    const events: SentEvent[] = [];
    for (;;) {
      const end = /\r?\n\r?\n/.exec(this.#rest);
      if (!end) return events;
      const block = this.#rest.slice(0, end.index);
      this.#rest = this.#rest.slice(end.index + end[0].length);
      const event: SentEvent = { id: "", event: "message", data: "" };
      const data: string[] = [];
      for (const line of block.split(/\r?\n/)) {
        const colon = line.indexOf(":");
        if (colon === 0) continue;
        const name = colon < 0 ? line : line.slice(0, colon);
        const value = colon < 0 ? "" : line.slice(colon + 1).replace(/^ /, "");
        if (name === "data") data.push(value);
        else if (name === "id") event.id = value;
        else if (name === "event") event.event = value;
      }
      if (data.length === 0) continue;
      event.data = data.join("\n");
      events.push(event);
    }
  }
}

const FINAL = new Set(["succeeded", "failed", "cancelled"]);

export function isOver(job: { state: string }): boolean {
  return FINAL.has(job.state);
}

const pause = (ms: number, signal: AbortSignal) =>
  new Promise<void>((resolve) => {
    const timer = setTimeout(resolve, ms);
    signal.addEventListener("abort", () => {
      clearTimeout(timer);
      resolve();
    });
  });

/** How the job is being followed. */
export type Following = "stream" | "poll" | "offline" | "over";

/**
 * Follows the job at `path` and tells `seen` of every state of it, until it is
 * over or `signal` says so. A stream that breaks off is taken up where it broke.
 */
export async function follow<J extends AnyJob>(
  path: string,
  seen: (job: J) => void,
  how: (following: Following) => void,
  signal: AbortSignal,
): Promise<void> {
  let last = "";
  let broken = 0;
  const refresh = async () => {
    const job = await askJson<J>(path, { signal });
    seen(job);
    return job;
  };
  while (!signal.aborted) {
    try {
      if (isOver(await refresh())) break;
      if (broken >= 2) {
        // Something in between holds streams back: asking does it too.
        how("poll");
        await pause(1000, signal);
        continue;
      }
      const before = last;
      const headers: Record<string, string> = { Accept: "text/event-stream" };
      if (last) headers["Last-Event-ID"] = last;
      const response = await ask(`${path}/events`, { headers, signal });
      const body = response.status === 204 ? null : response.body;
      if (body) {
        how("stream");
        const reader = body.pipeThrough(new TextDecoderStream()).getReader();
        const events = new EventReader();
        for (;;) {
          const { value, done } = await reader.read();
          if (done) break;
          const sent = events.push(value);
          if (sent.length === 0) continue;
          last = sent.findLast((event) => event.id)?.id ?? last;
          if (isOver(await refresh())) {
            how("over");
            return;
          }
        }
      }
      broken = last === before ? broken + 1 : 0;
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof ApiError && !error.offline && error.problem.status < 500) throw error;
      if (error instanceof ApiError && error.offline) how("offline");
      broken += error instanceof ApiError && error.offline ? 0 : 1;
      await pause(1500, signal);
    }
  }
  if (!signal.aborted) how("over");
}
