// A form made from the service's schema of options: groups of fields, each with
// its type, range, choices, default and help.

export interface Schema {
  type?: string | string[];
  description?: string;
  default?: unknown;
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  enum?: unknown[];
  const?: unknown;
  oneOf?: Schema[];
  anyOf?: Schema[];
  $ref?: string;
  $defs?: Record<string, Schema>;
  properties?: Record<string, Schema>;
}

export interface Choice {
  value: string;
  help: string;
}

export interface Field {
  /** Dotted name, as uploads take it. */
  name: string;
  /** For people, in words. */
  label: string;
  help: string;
  unit: string;
  kind: "number" | "integer" | "boolean" | "choice" | "json";
  choices: Choice[];
  min: number | null;
  max: number | null;
  /** May be without a value. */
  optional: boolean;
  initial: unknown;
}

export interface Group {
  name: string;
  label: string;
  help: string;
  fields: Field[];
}

const UNITS: [RegExp, string][] = [
  [/_px2$/, "px²"],
  [/_px$/, "px"],
  [/_deg$/, "°"],
  [/_percent$/, "%"],
  [/_m$/, "m"],
];

function resolved(schema: Schema, root: Schema): Schema {
  const name = schema.$ref?.replace(/^#\/\$defs\//, "");
  const target = name ? root.$defs?.[name] : undefined;
  return target ? { ...resolved(target, root), ...schema } : schema;
}

const text = (help: string | undefined) => (help ?? "").replace(/\s+/g, " ").trim();

export function labelOf(name: string): string {
  let words = name;
  for (const [suffix] of UNITS) words = words.replace(suffix, "");
  words = words.replaceAll("_", " ");
  return words.charAt(0).toUpperCase() + words.slice(1);
}

function field(name: string, key: string, given: Schema, root: Schema, initial: unknown): Field {
  let schema = resolved(given, root);
  let optional = false;
  const variants = schema.anyOf?.map((one) => resolved(one, root));
  if (variants?.some((one) => one.type === "null")) {
    optional = true;
    const other = variants.find((one) => one.type !== "null");
    if (other) schema = { ...other, ...schema };
  }
  let type = schema.type;
  if (Array.isArray(type)) {
    optional ||= type.includes("null");
    type = type.find((one) => one !== "null");
  }
  const oneOf = schema.oneOf ?? [];
  const constants = oneOf.filter((one) => typeof one.const === "string");
  const choices: Choice[] =
    constants.length > 0 && constants.length === oneOf.length
      ? constants.map((one) => ({ value: String(one.const), help: text(one.description) }))
      : (schema.enum ?? [])
          .filter((one): one is string => typeof one === "string")
          .map((value) => ({ value, help: "" }));
  const kind: Field["kind"] =
    choices.length > 0
      ? "choice"
      : type === "number" || type === "integer" || type === "boolean"
        ? type
        : "json";
  return {
    name,
    label: labelOf(key),
    help: text(given.description ?? schema.description),
    unit: UNITS.find(([suffix]) => suffix.test(key))?.[1] ?? "",
    kind,
    choices,
    min: schema.minimum ?? schema.exclusiveMinimum ?? null,
    max: schema.maximum ?? null,
    optional,
    initial: initial === undefined ? (schema.default ?? null) : initial,
  };
}

/** The groups of the form: the schema's own fields first, then one an object. */
export function groupsOf(root: Schema): Group[] {
  const groups: Group[] = [{ name: "", label: "", help: "", fields: [] }];
  const walk = (schema: Schema, path: string[], group: Group, defaults: unknown) => {
    for (const [key, given] of Object.entries(schema.properties ?? {})) {
      const inner = resolved(given, root);
      const initial = (defaults as Record<string, unknown> | undefined)?.[key];
      const own = initial === undefined ? inner.default : initial;
      if (!inner.properties) {
        group.fields.push(field([...path, key].join("."), key, given, root, own));
        continue;
      }
      const label = [...path, key].map((part, at) => (at ? part.replaceAll("_", " ") : labelOf(part)));
      const next: Group = {
        name: [...path, key].join("."),
        label: label.join(" › "),
        help: text(given.description ?? inner.description),
        fields: [],
      };
      groups.push(next);
      walk(inner, [...path, key], next, own);
    }
  };
  walk(root, [], groups[0] as Group, root.default);
  return groups.filter((group) => group.fields.length > 0);
}

/** Nested options of values by dotted name, those that differ from the default only. */
export function changed(groups: Group[], values: Record<string, unknown>): Record<string, unknown> {
  const options: Record<string, unknown> = {};
  for (const one of groups.flatMap((group) => group.fields)) {
    if (!(one.name in values)) continue;
    const value = values[one.name];
    if (JSON.stringify(value) === JSON.stringify(one.initial)) continue;
    let at = options;
    const path = one.name.split(".");
    for (const key of path.slice(0, -1)) {
      at = (at[key] ??= {}) as Record<string, unknown>;
    }
    at[path.at(-1) ?? one.name] = value;
  }
  return options;
}

/** Dotted names and values of nested options. */
export function flattened(options: unknown, path = ""): Record<string, unknown> {
  if (typeof options !== "object" || options === null || Array.isArray(options)) {
    return path ? { [path]: options } : {};
  }
  const entries = Object.entries(options).map(([key, value]) =>
    flattened(value, path ? `${path}.${key}` : key),
  );
  return Object.assign({}, ...entries) as Record<string, unknown>;
}

/** What of `options` the form can hold and differs from the defaults. */
export function valuesOf(groups: Group[], options: unknown): Record<string, unknown> {
  const values: Record<string, unknown> = {};
  for (const one of groups.flatMap((group) => group.fields)) {
    let at: unknown = options;
    for (const key of one.name.split(".")) at = (at as Record<string, unknown> | undefined)?.[key];
    if (at !== undefined && JSON.stringify(at) !== JSON.stringify(one.initial)) values[one.name] = at;
  }
  return values;
}

/** What of `options` the form has no field for: a misspelt name, for the service to refuse. */
export function strangersOf(groups: Group[], options: unknown): Record<string, unknown> {
  const names = groups.flatMap((group) => group.fields.map((one) => one.name));
  const all = Object.entries(flattened(options));
  return Object.fromEntries(
    all.filter(([name]) => !names.some((known) => name === known || name.startsWith(`${known}.`))),
  );
}
