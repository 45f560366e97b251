// Bundles the page into one file that the Rust crate embeds. Run after `npm ci`; commit the result.
import { createHash } from "node:crypto";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const out = new URL("../../crates/accurate3d/assets/", import.meta.url);
const { outputFiles } = await build({
  entryPoints: ["src/main.js"],
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2020",
  legalComments: "none",
  write: false,
});
// An inline script must not contain its own end tag.
const script = outputFiles[0].text.replaceAll("</script", "<\\/script").trim();
const style = readFileSync("src/style.css", "utf8").trim();
const page = readFileSync("src/page.html", "utf8");
const licence = readFileSync("node_modules/three/LICENSE", "utf8").trim();
// Only this script may run, and nothing may be fetched.
const hash = createHash("sha256").update(script).digest("base64");
const fill = (text, key, value) => text.split(key).join(value);
let html = fill(page, "{{SCRIPT_HASH}}", hash);
html = fill(html, "{{STYLE}}", style);
html = fill(html, "{{LICENCE}}", licence);
html = fill(html, "{{SCRIPT}}", script);
mkdirSync(out, { recursive: true });
writeFileSync(new URL("report.html", out), html);
writeFileSync(new URL("three-LICENSE.txt", out), licence + "\n");
console.log(`report.html: ${html.length} characters`);
