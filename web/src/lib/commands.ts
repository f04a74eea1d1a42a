// The equal commands: what a person did here, for a shell and for a program.

import { flattened } from "./options";

export interface Made {
  /** `source=ID`, which brings options along, `page=ID` or the files sent. */
  form: [name: string, value: string][];
  options: Record<string, unknown>;
  /** The model that comes out: `solid.glb`. */
  model: string;
}

const quoted = (value: string) =>
  /^[\w@%+=:,./-]+$/.test(value) ? value : `'${value.replaceAll("'", `'\\''`)}'`;

function fields(made: Made): [string, string][] {
  const options = Object.entries(flattened(made.options)).map(
    ([name, value]): [string, string] => [
      name,
      typeof value === "string" ? value : JSON.stringify(value),
    ],
  );
  return [...made.form, ...options];
}

/** For a shell. */
export function curl(made: Made, base: string, withKey: boolean): string {
  const parts = fields(made).map(([name, value]) => `-F ${quoted(`${name}=${value}`)}`);
  const key = withKey ? [`-H "Authorization: Bearer $TURNAROUND_KEY"`] : [];
  return ["curl -i", ...key, ...parts, quoted(`${base}v1/reconstructions`)].join(" \\\n  ");
}

/** For Python, with the library `requests`. */
export function python(made: Made, base: string, withKey: boolean): string {
  const isFile = (value: string) => value.startsWith("@");
  const all = fields(made);
  const string = (value: string) => JSON.stringify(value);
  const part = ([name, value]: [string, string]) =>
    isFile(value)
      ? `    (${string(name)}, open(${string(value.slice(1))}, "rb")),`
      : `    (${string(name)}, (None, ${string(value)})),`;
  const headers = withKey
    ? ['headers = {"Authorization": f"Bearer {os.environ[\'TURNAROUND_KEY\']}"}']
    : ["headers = {}"];
  return [
    ...(withKey ? ["import os"] : []),
    "import requests",
    "",
    `base = ${string(base)}`,
    ...headers,
    "parts = [",
    ...all.map(part),
    "]",
    'job = requests.post(base + "v1/reconstructions", files=parts, headers=headers).json()',
    'while job["state"] in ("queued", "running"):',
    '    job = requests.get(base + f"v1/reconstructions/{job[\'id\']}",',
    '                       headers={**headers, "Prefer": "wait=30"}).json()',
    `glb = requests.get(base + f"v1/reconstructions/{job['id']}/artifacts/${made.model}", headers=headers)`,
    `open("${made.model}", "wb").write(glb.content)`,
  ].join("\n");
}
