// What was dropped: told by names and, for pages and views, by their number.

import { unzipSync } from "fflate";

export type Dropped =
  | { kind: "page"; file: File }
  | { kind: "views"; files: File[] }
  | { kind: "sheet"; document: File; files: File[] }
  | { kind: "model"; file: File }
  | { kind: "nothing"; why: "empty" | "unknown" | "models" | "zip"; names: string[] };

const MODEL = /\.(glb|gltf|obj|ply|stl)$/i;
const PICTURE = /\.(png|jpe?g|webp|tiff?|gif|svg)$/i;
const ZIP = /\.zip$/i;
/** More than this unpacked is no sheet. */
const MOST_BYTES = 512 * 1024 * 1024;

/** The name at the end of a path. */
export const last = (path: string) => path.replace(/^.*[/\\]/, "");
const isHidden = (path: string) => /(^|[/\\])(\.|__MACOSX)/.test(path);

/** The path of an upload that is called so, if it is. */
export function named(path: string, name: string | null | undefined): string {
  const taken = nameOf(name ?? "");
  return taken ? `${path}?${new URLSearchParams({ name: taken })}` : path;
}

/** What a page or draft is called: its file's name, as far as the service takes it. */
export function nameOf(file: string): string {
  // 200 bytes at most, and letters of up to four.
  const plain = last(file).replace(/\p{Cc}/gu, " ").trim();
  return [...plain].slice(0, 50).join("");
}

/** Sorts files, those of folders and archives included. */
export function sortFiles(files: File[]): Dropped {
  const seen = files.filter((file) => !isHidden(file.webkitRelativePath || file.name));
  const names = seen.map((file) => file.name);
  if (seen.length === 0) return { kind: "nothing", why: "empty", names };
  const document = seen.find((file) => last(file.name) === "sheet.json");
  const pictures = seen.filter((file) => PICTURE.test(file.name));
  if (document) {
    const others = seen.filter((file) => file !== document);
    return { kind: "sheet", document, files: others };
  }
  const models = seen.filter((file) => MODEL.test(file.name));
  if (pictures.length === 0 && models.length === 1 && models[0]) {
    return { kind: "model", file: models[0] };
  }
  if (pictures.length === 0 && models.length > 1) return { kind: "nothing", why: "models", names };
  if (pictures.length === 1 && pictures[0]) return { kind: "page", file: pictures[0] };
  if (pictures.length > 1) {
    const collator = new Intl.Collator("en", { numeric: true });
    const views = [...pictures].sort((a, b) => collator.compare(a.name, b.name));
    return { kind: "views", files: views };
  }
  return { kind: "nothing", why: "unknown", names };
}

/** Unpacks archives among the files. */
export async function unpacked(files: File[]): Promise<File[]> {
  const all = await Promise.all(
    files.map(async (file) => (ZIP.test(file.name) ? unzipped(file) : [file])),
  );
  return all.flat();
}

async function unzipped(archive: File): Promise<File[]> {
  const bytes = new Uint8Array(await archive.arrayBuffer());
  let total = 0;
  const wanted = (name: string) =>
    !isHidden(name) && (PICTURE.test(name) || MODEL.test(name) || /\.(json|pfm|exr)$/i.test(name));
  // Not in a worker: the page's policy lets none be made of text.
  const entries = unzipSync(bytes, {
    filter: (entry) => {
      if (!wanted(entry.name)) return false;
      total += entry.originalSize;
      return total <= MOST_BYTES;
    },
  });
  if (total > MOST_BYTES) throw new Error("the archive unpacks to more than 512 MiB");
  return Object.entries(entries).map(
    ([name, content]) => new File([new Uint8Array(content)], last(name)),
  );
}

/** The files that a sheet document names, of those that came with it. */
export function filesOfSheet(document: unknown, files: File[]): File[] {
  const names = new Set<string>();
  const sheet = document as {
    views?: (Record<string, unknown> | null)[];
    truth?: Record<string, unknown> | null;
  } | null;
  const views = Array.isArray(sheet?.views) ? sheet.views : [];
  for (const view of views) {
    for (const key of ["image", "mask", "depth", "disparity"]) {
      const name = view?.[key];
      if (typeof name === "string") names.add(last(name));
    }
  }
  if (typeof sheet?.truth?.["model"] === "string") names.add(last(sheet.truth["model"]));
  return files.filter((file) => names.has(last(file.name)));
}

/** All files of a drop, folders walked through. */
export async function filesOfDrop(transfer: DataTransfer): Promise<File[]> {
  const entries = [...transfer.items]
    .filter((item) => item.kind === "file")
    .map((item) => item.webkitGetAsEntry());
  if (entries.every((entry) => entry === null)) return [...transfer.files];
  const files: File[] = [];
  const walk = async (entry: FileSystemEntry): Promise<void> => {
    if (files.length > 2000) return;
    if (entry.isFile) {
      const file = entry as FileSystemFileEntry;
      files.push(await new Promise<File>((resolve, reject) => file.file(resolve, reject)));
      return;
    }
    const reader = (entry as FileSystemDirectoryEntry).createReader();
    for (;;) {
      const some = await new Promise<FileSystemEntry[]>((resolve, reject) =>
        reader.readEntries(resolve, reject),
      );
      if (some.length === 0) return;
      for (const child of some) await walk(child);
    }
  };
  for (const entry of entries) if (entry) await walk(entry);
  return files;
}
