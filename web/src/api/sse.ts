// Server-sent events, read from text.

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
