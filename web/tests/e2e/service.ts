// Starts the service for all tests and stops it after them.
import { type ChildProcess, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";

export default async function start(): Promise<() => Promise<void>> {
  const program = resolve(process.env["TURNAROUND"] ?? "../target/debug/turnaround");
  const folder = mkdtempSync(join(tmpdir(), "turnaround-web-"));
  const service = spawn(
    program,
    ["serve", "--listen", "127.0.0.1:0", "--data-dir", folder, "--workers", "1"],
    { stdio: ["ignore", "pipe", "ignore"] },
  );
  process.env["TURNAROUND_URL"] = await address(service);
  return async () => {
    service.kill("SIGTERM");
    await new Promise((done) => service.once("exit", done));
    rmSync(folder, { recursive: true, force: true });
  };
}

function address(service: ChildProcess): Promise<string> {
  return new Promise((done, fail) => {
    let said = "";
    service.once("error", fail);
    service.once("exit", (code) => fail(new Error(`the service ended with ${code}: ${said}`)));
    service.stdout?.on("data", (data: Buffer) => {
      said += data.toString();
      const found = /http:\/\/\S+/.exec(said);
      if (found) done(`${found[0]}/`);
    });
  });
}
