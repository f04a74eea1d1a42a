// The page in Debian's Chromium against the real service, which each run starts
// on a free port with a folder of its own.
import { defineConfig } from "@playwright/test";

export default defineConfig({
  testDir: "tests/e2e",
  // What is timed is measured when asked for, not each time; so are the README's pictures taken.
  testIgnore: [
    ...(process.env["SPEED"] ? [] : ["speed.spec.ts"]),
    ...(process.env["PICTURES"] ? [] : ["pictures.spec.ts"]),
  ],
  globalSetup: "./tests/e2e/service.ts",
  // One service and two processors for all of them.
  workers: 1,
  timeout: 120_000,
  expect: { timeout: 30_000 },
  reporter: [["list"]],
  use: {
    browserName: "chromium",
    viewport: { width: 1280, height: 800 },
    colorScheme: "light",
    acceptDownloads: true,
    launchOptions: {
      executablePath: process.env["CHROMIUM"] ?? "/usr/bin/chromium",
      // Root in a container has no sandbox; 3D is drawn in software.
      args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
    },
  },
});
