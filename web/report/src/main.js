import { byId, element, keyTable, number, path, ramp, svg } from "./dom.js";
import { crossings, distance, lineIn1, lineIn2, nearest } from "./epipolar.js";
import { makePlot } from "./plot.js";
import { makeScene } from "./scene.js";
import { makeView } from "./view.js";

const data = JSON.parse(byId("data").textContent);
const { curve, views, unit } = data;
const count = curve.points.length;
const arc = curve.arc;
const percent = (v) => `${number(100 * v)} %`;
const words = (text) => text.replaceAll("_", " ").replaceAll("-", " ");

// Heading, verdict, key figures.
document.title = `${data.case} · accurate`;
byId("note").textContent = data.note;
byId("title").textContent = data.case;
byId("subtitle").textContent =
  `Reconstructed from ${data.input === "mask" ? "two masks" : data.input === "image" ? "two images" : "ordered points of two views"} · method ${data.method}`;
const verdict = byId("verdict");
if (data.suspicions.length) {
  verdict.classList.add("bad");
  verdict.append(element("b", {}, "Suspect. "), `${data.suspicions.join(", ")}. Look before you use it.`);
} else {
  verdict.classList.add("good");
  verdict.append(element("b", {}, "No reason to doubt. "), "Both views are explained; likely, not certain, to be right.");
}
const figure = (label, value, suffix) => byId("figures").append(
  element("div", { class: "figure" },
    element("div", { class: "value" }, value, ...(suffix ? [element("small", {}, suffix)] : [])),
    element("div", { class: "label" }, label)));
const d = data.diagnostics;
figure("length", number(arc[count - 1], 4), unit);
figure("points", String(count));
figure("mean epipolar distance", number(d.mean_epipolar_distance_px, 2), "px");
figure("body covered, view 1 / view 2", `${number(100 * d.trace_coverage[0] * d.matched_fraction[0])} / ${number(100 * d.trace_coverage[1] * d.matched_fraction[1])}`, "%");
if (curve.sigma) {
  const sorted = [...curve.sigma].sort((a, b) => a - b);
  figure("median σ across", number(sorted[sorted.length >> 1], 2), unit);
  figure("largest σ across", number(sorted[sorted.length - 1], 2), unit);
}
figure("along epipolar lines", number(100 * d.along_epipolar_line), "%");
if (data.scores) {
  figure("Overall, to the truth", number(data.scores.overall, 3), unit);
  figure("Max Err", number(data.scores.max_error, 3), unit);
}

// The two views.
const projected = [curve.pixels1, curve.pixels2];
const colours = ["one", "two"];
const panels = views.map((view, k) => {
  byId(`kind${k + 1}`).textContent = view.kind === "none" ? "trace only" : view.kind;
  return makeView(byId(`view${k + 1}`), view, projected[k], curve.along, colours[k], (i) => pick(i));
});

// The 3D view; without WebGL everything else still works.
let scene = null;
const ramps = {};
if (curve.sigma) ramps["σ"] = curve.sigma;
ramps["epipolar distance"] = curve.distance;
ramps["arc length"] = arc;
try {
  scene = makeScene(byId("scene"), data, (i) => pick(i));
} catch (error) {
  byId("scene").append(element("div", { class: "absent" },
    "This browser offers no WebGL, so the curve is not drawn in 3D. The views, the slider and the tables work."));
}
const rgb = ([r, g, b]) => `rgb(${r},${g},${b})`;
const colourSelect = byId("colour");
for (const name of ["plain", ...Object.keys(ramps)]) colourSelect.append(element("option", { value: name }, name));
const tubeSelect = byId("tube");
if (curve.sigma) {
  for (const factor of [0, 1, 5, 20]) tubeSelect.append(element("option", { value: factor }, factor ? `±1.96 σ × ${factor}` : "off"));
} else {
  byId("tube-label").hidden = true;
}
function recolour() {
  const name = colourSelect.value;
  const values = ramps[name];
  const legend = byId("legend");
  const swatch = (colour, text) => {
    const i = element("i");
    i.style.background = colour;
    legend.append(element("span", {}, i, text));
  };
  legend.replaceChildren();
  const plain = getComputedStyle(document.documentElement).getPropertyValue("--curve").trim();
  if (values) {
    const low = Math.min(...values), high = Math.max(...values), range = high - low || 1;
    scene?.colour((i) => rgb(ramp((values[i] - low) / range)));
    const i = element("i", { class: "ramp" });
    i.style.background = `linear-gradient(90deg,${[0, 0.33, 0.66, 1].map((t) => rgb(ramp(t))).join(",")})`;
    legend.append(element("span", {}, `${number(low)} `, i, `${number(high)} ${name === "epipolar distance" ? "px" : unit}`));
  } else {
    scene?.colour(() => plain);
    swatch("var(--curve)", "reconstructed curve");
  }
  if (data.truth) swatch("var(--truth)", "truth");
  if (cut) swatch("color-mix(in srgb, var(--curve) 30%, transparent)", "tube, cut off where it is wider than shown");
  if (curve.along.some(Boolean)) swatch("var(--flag)", "along an epipolar line (depth weakly seen)");
  swatch("var(--one)", "ray and trace of view 1");
  swatch("var(--two)", "ray and trace of view 2");
}
colourSelect.addEventListener("change", recolour);
let cut = false;
function retube() {
  cut = scene?.setTube(Number(tubeSelect.value)) ?? false;
  recolour();
}
tubeSelect.addEventListener("change", retube);
byId("reset").addEventListener("click", () => scene?.reset());
if (curve.sigma) {
  // Thin tubes cannot be seen at true size: begin with one that can.
  const sorted = [...curve.sigma].sort((a, b) => a - b);
  const box = [0, 1, 2].map((k) => {
    const v = curve.points.map((p) => p[k]);
    return Math.max(...v) - Math.min(...v);
  });
  const relative = (1.96 * sorted[sorted.length >> 1]) / (Math.max(...box) || 1);
  tubeSelect.value = String(relative > 0.012 ? 1 : relative > 0.0025 ? 5 : 20);
  retube();
}

// The profile along the curve.
const series = [{ name: "epipolar distance", values: curve.distance, colour: "one" }];
const profile = curve.sigma
  ? makePlot(byId("profile"), arc, [{ values: curve.sigma, colour: "curve" }], curve.along, unit, (i) => pick(i))
  : makePlot(byId("profile"), arc, series, curve.along, unit, (i) => pick(i));

// The correspondence matrix.
const [trace1, trace2] = [views[0].trace, views[1].trace];
let lastCells = [null, null];
const cells = curve.pixels1.map((p, i) => [nearestAlong(trace1, p, i), nearestAlong(trace2, curve.pixels2[i], i)]);
// Where strands cross, the nearest trace point may be on the wrong strand: stay near the last one.
function nearestAlong(trace, p, i) {
  const which = trace === trace1 ? 0 : 1;
  const before = lastCells?.[which];
  let best = nearest(trace, p);
  if (before !== null && before !== undefined && i > 0) {
    let near = Infinity;
    const reach = Math.max(6, Math.ceil(8 * trace.length / count));
    for (let j = Math.max(0, before - reach); j <= Math.min(trace.length - 1, before + reach); j++) {
      const e = Math.hypot(trace[j][0] - p[0], trace[j][1] - p[1]);
      if (e < near) { near = e; best = j; }
    }
    if (near > 4) best = nearest(trace, p);
  }
  if (lastCells) lastCells[which] = best;
  return best;
}
let cross = null;
if (data.match) {
  const { rows, columns } = data.match;
  byId("matrix-text").textContent =
    `Rows: points of view 1 in order, ${rows}; columns: points of view 2, ${columns}. Dark where the epipolar distance is small: every dark cell could be a pair. The line is the pairing of this curve.`;
  const root = svg("svg", { viewBox: `0 0 ${columns} ${rows}`, preserveAspectRatio: "none" });
  byId("matrix").style.setProperty("--cells", `${columns}/${rows}`);
  root.append(svg("image", { href: data.match.image, x: 0, y: 0, width: columns, height: rows, preserveAspectRatio: "none" }));
  root.append(svg("path", { d: path(cells.map(([i, j]) => [j + 0.5, i + 0.5])), fill: "none", stroke: "var(--curve)",
    "stroke-width": 2, "vector-effect": "non-scaling-stroke" }));
  cross = svg("path", { fill: "none", stroke: "var(--pick)", "stroke-width": 1.2, "vector-effect": "non-scaling-stroke" });
  root.append(cross);
  root.addEventListener("click", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(root.getScreenCTM().inverse());
    pick(nearest(cells.map(([i, j]) => [j, i]), [at.x, at.y]));
  });
  byId("matrix").append(root);
}

// Curves considered.
const rivals = data.candidates;
if (rivals.length) {
  byId("choice-text").textContent = rivals.length === 1
    ? "One curve came to the last choice; no other explained the outlines."
    : "Each row is a pair of walks through the two skeletons that was fitted to both outlines and came to the last choice. The likeliest of those with a score near the least wins (the one with the least unlikeliness: bends weighed by how the body bends elsewhere). Point at a row to see it dashed in both views.";
  const columns = [["", (c, i) => (i === 0 ? "chosen" : "")], ["walks, view 1 / view 2", (c) => `${c.walks[0] + 1} / ${c.walks[1] + 1}${c.reversed ? ", reversed" : ""}`],
    ["score", (c) => number(c.score, 4)], ["unlikeliness", (c) => c.unlikeliness === null ? "" : number(c.unlikeliness, 4)], ["outline unexplained", (c) => number(c.unexplained, 2)], ["outside mask", (c) => number(c.outside, 2)],
    ["mean squared residual, px²", (c) => number(c.chi_per_point, 3)], ["epipolar disagreement, px", (c) => number(c.mean_distance_px, 2)]];
  byId("candidates").querySelector("thead").append(element("tr", {}, ...columns.map(([name]) => element("th", {}, name))));
  rivals.forEach((c, i) => {
    const row = element("tr", { class: i === 0 ? "hot chosen" : "hot" }, ...columns.map(([, of]) => element("td", {}, of(c, i))));
    row.addEventListener("pointerenter", () => panels.forEach((panel, k) => panel.rival(c.pixels[k])));
    row.addEventListener("pointerleave", () => panels.forEach((panel) => panel.rival(null)));
    byId("candidates").querySelector("tbody").append(row);
  });
} else {
  byId("choice").hidden = true;
}

// Junction decisions.
const decisions = data.junctions.flatMap((list, k) => list.map((junction) => ({ ...junction, view: k })));
if (decisions.length) {
  for (const junction of decisions) {
    const others = junction.alternatives.length
      ? junction.alternatives.map((a) => `${a.way}, ${number(a.price, 3)}`).join("; ")
      : "no other way";
    const row = element("tr", { class: "hot" },
      element("td", {}, String(junction.view + 1)),
      element("td", { class: "mono" }, `${number(junction.at[0], 4)}, ${number(junction.at[1], 4)}`),
      element("td", {}, `${junction.taken}, ${number(junction.price, 3)}`), element("td", {}, others));
    row.addEventListener("pointerenter", () => panels[junction.view].mark([junction.at]));
    row.addEventListener("pointerleave", () => panels[junction.view].mark([]));
    row.addEventListener("click", () => pick(nearest(projected[junction.view], junction.at)));
    byId("decisions").querySelector("tbody").append(row);
  }
} else {
  byId("junctions").hidden = true;
}

// Tables.
const flat = (value, name = "") =>
  value === null || value === undefined ? []
  : Array.isArray(value) ? [[name, value.map((v) => (typeof v === "number" ? number(v, 4) : v)).join(", ") || "none"]]
  : typeof value === "object" ? Object.entries(value).flatMap(([k, v]) => flat(v, name ? `${name}, ${words(k)}` : words(k)))
  : [[name, typeof value === "number" ? number(value, 4) : String(value)]];
const { evidence, ...outline } = d.outline ?? {};
keyTable(byId("diagnostics"), flat(d.outline ? { ...d, outline } : d));
if (evidence) keyTable(byId("evidence"), flat(evidence));
else byId("evidence").parentElement.hidden = true;
if (data.scores) keyTable(byId("scores"), flat(data.scores).map(([k, v]) => [k, `${v} ${unit}`]));
else byId("scores-card").append(element("p", { class: "muted small" }, "The pair has no truth; nothing is scored."));
const p = data.provenance;
keyTable(byId("provenance"), [["made by", `accurate ${p.version}`], ["pair", p.pair], ["method", data.method], ["input", data.input], ["unit", unit]]);
for (const [stage, text] of Object.entries(p.parameters)) byId("parameters").append(element("div", { class: "muted small" }, stage), element("pre", {}, text));
keyTable(byId("inputs"), p.inputs.map((i) => [i.file, i.blake3]));
byId("footer").textContent = `${data.note} This file is complete in itself: it loads nothing and sends nothing.`;

// Picking a point.
let selected = -1;
const facts = byId("point");
function pick(i) {
  selected = Math.min(count - 1, Math.max(0, i));
  i = selected;
  const [p1, p2] = [curve.pixels1[i], curve.pixels2[i]];
  const partners = crossings(lineIn2(data.fundamental, p1), trace2);
  panels[0].pick(p1, lineIn1(data.fundamental, p2), []);
  panels[1].pick(p2, lineIn2(data.fundamental, p1), partners.map((c) => c.at));
  scene?.pick(i);
  profile.pick(i);
  const [row, column] = cells[i];
  if (cross) {
    const { rows, columns } = data.match;
    cross.setAttribute("d", `M0 ${row + 0.5}H${columns}M${column + 0.5} 0V${rows}`);
  }
  byId("index").textContent = `${i + 1} of ${count}`;
  byId("where").textContent = `${number(arc[i], 4)} ${unit} along the curve`;
  byId("p1").textContent = p1.map((v) => v.toFixed(2)).join(", ");
  byId("p2").textContent = p2.map((v) => v.toFixed(2)).join(", ");
  byId("cell").textContent = `cell (${row}, ${column})`;
  byId("slider").value = i;
  const fact = (label, value) => element("div", { class: "fact" }, element("span", {}, label), value);
  facts.replaceChildren(
    fact(`position, ${unit}`, curve.points[i].map((v) => number(v, 5)).join(", ")),
    fact("pixel in view 1 / view 2", `${p1.map((v) => v.toFixed(1)).join(", ")} / ${p2.map((v) => v.toFixed(1)).join(", ")}`),
    fact("epipolar distance", `${number(curve.distance[i], 2)} px`),
    ...(curve.sigma ? [fact("σ across the curve", `${number(curve.sigma[i], 2)} ${unit}`)] : []),
    fact("matched", `point ${row} of view 1 with point ${column} of view 2`),
    fact("seen", curve.along[i] ? "along an epipolar line: depth carried over from its neighbours" : "across epipolar lines"));
  // The crossing nearest to the pairing in order is the one chosen.
  const body = byId("partners").querySelector("tbody");
  body.replaceChildren();
  const chosen = partners.reduce((best, c, k) =>
    best < 0 || Math.abs(c.j - column) < Math.abs(partners[best].j - column) ? k : best, -1);
  partners.forEach((c, k) => {
    const taken = k === chosen && Math.hypot(c.at[0] - p2[0], c.at[1] - p2[1]) < 6;
    body.append(element("tr", { class: taken ? "chosen" : "" }, element("td", {}, String(c.j)),
      element("td", { class: "mono" }, c.at.map((v) => v.toFixed(1)).join(", ")),
      element("td", {}, `${number(Math.hypot(c.at[0] - p2[0], c.at[1] - p2[1]), 3)} px`),
      element("td", {}, taken ? "chosen" : "")));
  });
  if (!partners.length) {
    body.append(element("tr", {}, element("td", { colspan: 4, class: "muted" }, "the line does not meet the trace: the point lies beyond what view 2 shows")));
  }
  document.documentElement.dataset.selected = String(i);
}
byId("slider").max = count - 1;
byId("slider").addEventListener("input", (event) => pick(Number(event.target.value)));
document.addEventListener("keydown", (event) => {
  if (event.target.matches("select,input[type=range]")) return;
  const step = event.shiftKey ? 10 : 1;
  if (event.key === "ArrowRight") pick(selected + step);
  if (event.key === "ArrowLeft") pick(selected - step);
});

// Light and dark.
function theme(name) {
  document.documentElement.dataset.theme = name;
  scene?.theme();
  recolour();
}
byId("theme").addEventListener("click", () =>
  theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"));
theme(matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light");
pick(Math.floor(count / 3));

// For tests: what is shown, and where.
window.accurateReport = { count, pick, selected: () => selected, project: (i) => scene?.project(i) ?? null, distance };
