// Node 18 has File, but not everywhere.
import { File as NodeFile } from "node:buffer";

globalThis.File ??= NodeFile as unknown as typeof globalThis.File;
