// Sigma and epipolar distance along the curve, with a cursor.
import { svg, path, number } from "./dom.js";

const WIDTH = 1000, HEIGHT = 150, LEFT = 58, RIGHT = 10, TOP = 12, BOTTOM = 24;

export function makePlot(holder, arc, series, flags, unit, onPick) {
  const root = svg("svg", { class: "plot", viewBox: `0 0 ${WIDTH} ${HEIGHT}`, preserveAspectRatio: "none" });
  const length = arc[arc.length - 1] || 1;
  const x = (s) => LEFT + (s / length) * (WIDTH - LEFT - RIGHT);
  const top = Math.max(...series.flatMap((s) => s.values), 1e-12) * 1.08;
  const y = (v) => HEIGHT - BOTTOM - (v / top) * (HEIGHT - TOP - BOTTOM);
  flags.forEach((flag, i) => {
    if (!flag) return;
    const next = arc[Math.min(i + 1, arc.length - 1)];
    root.append(svg("rect", { x: x(arc[i]), y: TOP, width: Math.max(0.8, x(next) - x(arc[i])),
      height: HEIGHT - TOP - BOTTOM, fill: "var(--flag)", "fill-opacity": 0.28 }));
  });
  for (const share of [0, 0.5, 1]) {
    const v = (share * top) / 1.08;
    root.append(svg("path", { d: `M${LEFT} ${y(v)}H${WIDTH - RIGHT}`, stroke: "var(--line)", "vector-effect": "non-scaling-stroke" }));
    root.append(svg("text", { x: LEFT - 6, y: y(v) + 4, "text-anchor": "end" }, number(v, 2)));
    root.append(svg("text", { x: x(share * length), y: HEIGHT - 7, "text-anchor": ["start", "middle", "end"][share * 2] },
      `${number(share * length)}${share === 1 ? ` ${unit}` : ""}`));
  }
  for (const s of series) {
    root.append(svg("path", { d: path(s.values.map((v, i) => [x(arc[i]), y(v)])), fill: "none",
      stroke: `var(--${s.colour})`, "stroke-width": 1.6, "vector-effect": "non-scaling-stroke" }));
  }
  const cursor = svg("path", { stroke: "var(--pick)", "stroke-width": 1.4, "vector-effect": "non-scaling-stroke" });
  root.append(cursor);
  root.addEventListener("click", (event) => {
    const box = root.getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width * WIDTH - LEFT) / (WIDTH - LEFT - RIGHT) * length;
    let best = 0;
    arc.forEach((s, i) => { if (Math.abs(s - at) < Math.abs(arc[best] - at)) best = i; });
    onPick(best);
  });
  holder.append(root);
  return { pick(i) { cursor.setAttribute("d", `M${x(arc[i])} ${TOP - 4}V${HEIGHT - BOTTOM}`); } };
}
