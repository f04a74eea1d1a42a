// A job followed to its end: server-sent events over fetch, for EventSource sends
// no key; where they do not come through, the job is asked for again and again.

import { ApiError, ask, askJson } from "./client";
import { EventReader } from "./sse";
import type { AnyJob } from "./types";

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
  /** Reads on until the stream ends or breaks. */
  const stream = async () => {
    const headers: Record<string, string> = { Accept: "text/event-stream" };
    if (last) headers["Last-Event-ID"] = last;
    const response = await ask(`${path}/events`, { headers, signal });
    // 204: the final event was received already.
    const body = response.status === 204 ? null : response.body;
    if (!body) return;
    how("stream");
    const reader = body.pipeThrough(new TextDecoderStream()).getReader();
    const events = new EventReader();
    for (;;) {
      const { value, done } = await reader.read();
      if (done) return;
      const sent = events.push(value);
      if (sent.length === 0) continue;
      last = sent.findLast((event) => event.id)?.id ?? last;
      // The last event of all: what follows is the end, not a break.
      if (isOver(await refresh())) return;
    }
  };
  while (!signal.aborted) {
    try {
      if (isOver(await refresh())) break;
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof ApiError)) throw error;
      if (!error.offline && error.problem.status < 500) throw error;
      how("offline");
      await pause(1500, signal);
      continue;
    }
    if (broken >= 2) {
      // Something in between holds streams back: asking does it too.
      how("poll");
      await pause(1000, signal);
      continue;
    }
    const before = last;
    try {
      await stream();
    } catch {
      if (signal.aborted) return;
      await pause(500, signal);
    }
    broken = last === before ? broken + 1 : 0;
  }
  if (!signal.aborted) how("over");
}
