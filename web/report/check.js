// Opens reports in a headless Chromium without network and uses them as a reader would.
//
//   node check.js REPORT.html...            checks; exit 1 on the first failure
//   node check.js --shots DIR REPORT.html...  also writes screenshots and, where one of the same
//                                           name is in DIR already, compares with it first
//
// CHROMIUM names the browser (default /usr/bin/chromium).
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, dirname, join, resolve } from "node:path";
import { chromium } from "playwright-core";

const words = process.argv.slice(2);
let shots = null;
if (words[0] === "--shots") { shots = resolve(words[1]); words.splice(0, 2); mkdirSync(shots, { recursive: true }); }
const executablePath = process.env.CHROMIUM ?? "/usr/bin/chromium";
if (!existsSync(executablePath)) {
  console.log(`skipped: no browser at ${executablePath}`);
  process.exit(0);
}
// The largest share of pixels that may differ from an accepted screenshot: text and lines are
// smoothed differently by other builds of the browser; a moved panel changes several per cent.
const MOST_CHANGED = 0.01;

const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking"],
});
let failed = 0;
const expect = (holds, what) => {
  if (!holds) { failed += 1; console.log(`  FAIL ${what}`); }
};

// Compares a screenshot with the accepted one of that name, or keeps it where there is none.
async function accept(page, name, png) {
  const known = join(shots, `${name}.png`);
  if (!existsSync(known)) {
    writeFileSync(known, png);
    console.log(`  written: ${known}`);
    return;
  }
  const changed = await page.evaluate(async ([a, b]) => {
    const draw = async (data) => {
      const image = new Image();
      image.src = `data:image/png;base64,${data}`;
      await image.decode();
      const canvas = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
      const context = canvas.getContext("2d");
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    };
    const [p, q] = [await draw(a), await draw(b)];
    if (p.width !== q.width || p.height !== q.height) return 1;
    let different = 0;
    for (let i = 0; i < p.data.length; i += 4) {
      const d = Math.max(...[0, 1, 2].map((c) => Math.abs(p.data[i + c] - q.data[i + c])));
      if (d > 40) different += 1;
    }
    return different / (p.data.length / 4);
  }, [readFileSync(known).toString("base64"), png.toString("base64")]);
  expect(changed <= MOST_CHANGED, `${(100 * changed).toFixed(2)} % of the pixels differ from ${known}`);
  console.log(`  ${(100 * changed).toFixed(2)} % of the pixels differ from the accepted ${name}.png`);
}

for (const file of words) {
  const path = resolve(file);
  console.log(path);
  const context = await browser.newContext({ viewport: { width: 1440, height: 1000 }, offline: true, colorScheme: "light" });
  const page = await context.newPage();
  // Software rendering on a busy machine is slow; how fast it is is not checked here.
  page.setDefaultTimeout(120_000);
  const complaints = [];
  const asked = [];
  page.on("console", (message) => { if (["error", "warning"].includes(message.type()) && !/GPU stall|GL Driver/.test(message.text())) complaints.push(message.text()); });
  page.on("pageerror", (error) => complaints.push(String(error)));
  page.on("request", (request) => { if (!/^(file|data):/.test(request.url())) asked.push(request.url()); });
  await page.goto(`file://${path}`);
  await page.waitForFunction(() => window.accurateReport?.selected() >= 0);
  const count = await page.evaluate(() => window.accurateReport.count);
  const picked = () => page.evaluate(() => window.accurateReport.selected());

  // A click on a point in space selects that point, or one that hides it there.
  const scene = page.locator("#scene");
  const box = await scene.boundingBox();
  for (const share of [0.12, 0.5, 0.83]) {
    const index = Math.floor(share * (count - 1));
    const at = await page.evaluate((i) => window.accurateReport.project(i), index);
    expect(at !== null, "the 3D view is there");
    if (!at) break;
    await page.mouse.click(box.x + at[0], box.y + at[1]);
    const chosen = await picked();
    const there = await page.evaluate((i) => window.accurateReport.project(i), chosen);
    const off = Math.hypot(there[0] - at[0], there[1] - at[1]);
    // Clicks land on whole pixels; the picker looks 14 px around and prefers what is in front.
    const near = await page.evaluate(([i, j]) => Math.abs(i - j), [chosen, index]);
    expect(near <= 0.02 * count + 4 || there[2] < at[2], `click on point ${index} chose ${chosen}`);
    expect(off <= 14, `click on point ${index} chose one ${off.toFixed(1)} px away`);
    // Everything else follows the choice.
    expect((await page.textContent("#index")).startsWith(`${chosen + 1} of`), "the point's card follows");
    expect(Number(await page.inputValue("#slider")) === chosen, "the slider follows");
    const [one, two] = await page.evaluate(() => {
      const { curve, fundamental: f } = JSON.parse(document.getElementById("data").textContent);
      const i = window.accurateReport.selected();
      const [x, y] = curve.pixels2[i];
      const line = f.map((row) => row[0] * x + row[1] * y + row[2]);
      return [curve.distance[i], window.accurateReport.distance(line, curve.pixels1[i])];
    });
    // Pixels are printed to 0.01: each end may be off by 0.005 in either axis, and so may the value.
    expect(Math.abs(one - two) < 0.05, `the page's epipolar distance ${two} is the result's ${one}`);
  }
  // A click in view 1 selects the nearest point of the curve.
  const target = Math.floor(0.3 * count);
  const spot = await page.evaluate((i) => {
    const { curve } = JSON.parse(document.getElementById("data").textContent);
    const root = document.querySelector("#view1 svg");
    const p = new DOMPoint(...curve.pixels1[i]).matrixTransform(root.getScreenCTM());
    return [p.x, p.y];
  }, target);
  await page.locator("#view1").scrollIntoViewIfNeeded();
  await page.mouse.click(...spot);
  const apart = await page.evaluate(([i, j]) => {
    const { curve } = JSON.parse(document.getElementById("data").textContent);
    return Math.hypot(...[0, 1].map((k) => curve.pixels1[i][k] - curve.pixels1[j][k]));
  }, [await picked(), target]);
  expect(apart < 3, `a click in view 1 chose a point ${apart.toFixed(1)} px away`);
  await page.keyboard.press("ArrowRight");
  const views = await page.locator(".view svg path").count();
  expect(views >= 6, "traces and lines are drawn");
  // The theme changes; nothing complains.
  await page.click("#theme");
  expect(await page.evaluate(() => document.documentElement.dataset.theme) === "dark", "dark theme");
  await page.click("#theme");
  await page.setViewportSize({ width: 480, height: 900 });
  const wide = await page.evaluate(() => document.documentElement.scrollWidth);
  expect(wide <= 480, `the page is ${wide} px wide on a 480 px screen`);
  await page.setViewportSize({ width: 1440, height: 1000 });
  expect(complaints.length === 0, `console: ${complaints.join(" | ")}`);
  expect(asked.length === 0, `requests: ${asked.join(" ")}`);

  if (shots) {
    await page.evaluate(() => { window.accurateReport.pick(Math.floor(window.accurateReport.count / 3)); window.scrollTo(0, 0); });
    await page.waitForTimeout(800);
    const name = basename(path, ".html") === "report" ? basename(dirname(path)) : basename(path, ".html");
    await accept(page, name, await page.screenshot({ timeout: 600_000 }));
    // Once all of a page, with everything that a page can have.
    if (await page.locator("#junctions").isVisible()) {
      await accept(page, `${name}-whole`, await page.screenshot({ fullPage: true, timeout: 600_000 }));
    }
  }
  await context.close();
}
await browser.close();
console.log(failed ? `${failed} checks failed` : "all checks hold");
process.exit(failed ? 1 : 0);
