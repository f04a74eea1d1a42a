// The pictures of the README, taken anew when asked for: npm run pictures.
import { expect, test } from "@playwright/test";
import { STAGE, fileOf, give, open, sheet } from "./help";

const DOCS = "../docs";
/** As large as the README shows them. */
const SCALE = 0.75;

test("the pictures of the README", async ({ browser }) => {
  const id = await sheet("0,45,90,135,180");
  const wide = await browser.newPage({ viewport: { width: 1280, height: 800 }, deviceScaleFactor: SCALE });
  await open(wide);
  await give(wide, [await fileOf(id, "page.png", "hero.png")]);
  await wide.waitForURL(/#\/page\//);
  await expect(wide.getByRole("button", { name: /^Figure \d at/ })).toHaveCount(5);
  await wide.getByRole("button", { name: /^Figure 2 · / }).click();
  // All shades and the thumbnail are there, and no cursor is over anything.
  await wide.mouse.move(0, 0);
  await expect(wide.locator("svg image.shade")).toHaveCount(5);
  await wide.waitForLoadState("networkidle");
  await wide.screenshot({ path: `${DOCS}/web-page.png` });

  await wide.getByRole("button", { name: /Make the 3D draft/ }).click();
  await expect(wide.getByTestId("state")).toHaveText("Done", { timeout: 90_000 });
  await expect(wide.locator(STAGE)).toBeVisible();
  await wide.getByRole("group", { name: "Look from" }).getByRole("button", { name: "45°" }).click();
  await wide.evaluate(() => (document.activeElement as HTMLElement).blur());
  await wide.mouse.move(0, 0);
  await wide.evaluate(() => scrollTo(0, 0));
  await wide.waitForTimeout(500);
  await wide.screenshot({ path: `${DOCS}/web-draft.png` });

  const phone = { width: 390, height: 844 };
  const narrow = await browser.newPage({ viewport: phone, colorScheme: "dark" });
  await open(narrow, new URL(wide.url()).hash);
  await expect(narrow.locator(STAGE)).toBeVisible();
  await narrow.getByRole("group", { name: "Look from" }).getByRole("button", { name: "45°" }).click();
  await narrow.evaluate(() => (document.activeElement as HTMLElement).blur());
  await narrow.evaluate(() => scrollTo(0, 0));
  await narrow.waitForTimeout(500);
  await narrow.screenshot({ path: `${DOCS}/web-narrow.png` });
});
