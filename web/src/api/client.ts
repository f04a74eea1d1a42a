// The service's API over fetch: relative addresses, the key, problem details.

import { key } from "./key.svelte";

/** A problem as the service tells it (RFC 9457). */
export interface ProblemDocument {
  type: string;
  title: string;
  status: number;
  detail: string;
  part?: string;
  parameter?: string;
  errors?: { option: string; detail: string }[];
}

/** An answer that is no success, or none at all. */
export class ApiError extends Error {
  constructor(
    readonly problem: ProblemDocument,
    /** Nothing was answered: the network or the service is away. */
    readonly offline = false,
  ) {
    super(problem.detail);
  }
}

/** The document's own address without its hash: all others are relative to it. */
export function address(path: string, base: string = document.baseURI): string {
  return new URL(path.replace(/^\/+/, ""), base.replace(/#.*$/, "")).toString();
}

async function problemOf(response: Response): Promise<ProblemDocument> {
  const text = await response.text();
  try {
    return JSON.parse(text) as ProblemDocument;
  } catch {
    // A proxy in between answers in its own words.
    return {
      type: "about:blank",
      title: response.statusText || `HTTP ${response.status}`,
      status: response.status,
      detail: text.slice(0, 300) || `the answer was HTTP ${response.status}`,
    };
  }
}

/** Asks the service; asks a person for the key where it is wanted. */
export async function ask(path: string, init: RequestInit = {}): Promise<Response> {
  for (;;) {
    const used = key.value;
    const headers = new Headers(init.headers);
    if (used) headers.set("Authorization", `Bearer ${used}`);
    // The page's policy lets it reach the service alone, not the bucket behind it.
    headers.append("Prefer", "no-redirect");
    let response: Response;
    try {
      response = await fetch(address(path), { ...init, headers, credentials: "omit" });
    } catch (error) {
      if (error instanceof DOMException && error.name === "AbortError") throw error;
      throw new ApiError(
        { type: "about:blank", title: "", status: 0, detail: String(error) },
        true,
      );
    }
    if (response.status === 401) {
      await key.ask(used);
      continue;
    }
    if (response.ok || response.status === 304) return response;
    throw new ApiError(await problemOf(response));
  }
}

/** Asks for JSON. */
export async function askJson<T>(path: string, init?: RequestInit): Promise<T> {
  return (await (await ask(path, init)).json()) as T;
}
