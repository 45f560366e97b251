// One X-ray (or mask) with the trace, the curve's projection, epipolar lines and the picked pixel.
import { svg, path } from "./dom.js";
import { clip, nearest } from "./epipolar.js";

export function makeView(holder, view, projected, flags, colour, onPick) {
  const box = [-0.5, -0.5, view.width - 0.5, view.height - 0.5];
  const root = svg("svg", { role: "img" });
  const stroke = (name, width, opacity = 1) =>
    ({ fill: "none", stroke: `var(--${name})`, "stroke-width": width, "stroke-opacity": opacity,
       "vector-effect": "non-scaling-stroke", "stroke-linejoin": "round", "stroke-linecap": "round" });
  if (view.image) {
    root.append(svg("image", { href: view.image, x: -0.5, y: -0.5, width: view.width, height: view.height,
      opacity: view.kind === "mask" ? 0.42 : 1 }));
  }
  root.append(svg("path", { ...stroke(colour, 2.6, 0.55), d: path(view.trace) }));
  root.append(svg("path", { ...stroke("curve", 1.5), d: path(projected) }));
  // Stretches along epipolar lines: weakly seen.
  let run = [];
  const flush = () => {
    if (run.length > 1) root.append(svg("path", { ...stroke("flag", 3.4, 0.75), d: path(run) }));
    run = [];
  };
  projected.forEach((p, i) => (flags[i] ? run.push(p) : flush()));
  flush();
  const rival = svg("path", { ...stroke("pick", 1.6, 0.95), "stroke-dasharray": "5 4" });
  const line = svg("path", stroke("pick", 1.2, 0.9));
  const marks = svg("g");
  const dot = svg("g");
  root.append(rival, line, marks, dot);
  holder.append(root);

  // The body with some room around it; a double click shows the whole image and back.
  const all = [...view.trace, ...projected];
  const ends = [0, 1].map((k) => [Math.min(...all.map((p) => p[k])), Math.max(...all.map((p) => p[k]))]);
  const half = Math.max(0.62 * (ends[0][1] - ends[0][0]), 0.62 * (ends[1][1] - ends[1][0]), 0.08 * view.width);
  const middle = ends.map(([low, high]) => (low + high) / 2);
  const body = [middle[0] - half, middle[1] - half, middle[0] + half, middle[1] + half];
  let frame = [...body];
  const show = () => root.setAttribute("viewBox",
    `${frame[0]} ${frame[1]} ${frame[2] - frame[0]} ${frame[3] - frame[1]}`);
  const scale = () => (frame[2] - frame[0]) / (box[2] - box[0]);
  const circle = (p, r, attributes) =>
    svg("circle", { cx: p[0], cy: p[1], r: r * scale() * view.width / 512, ...attributes });
  let last = null, markList = [];
  const redraw = () => {
    dot.replaceChildren();
    marks.replaceChildren();
    for (const p of markList) {
      marks.append(circle(p, 6, { fill: "none", stroke: "var(--flag)", "stroke-width": 2,
        "vector-effect": "non-scaling-stroke" }));
    }
    if (!last) return;
    for (const p of last.others) {
      dot.append(circle(p, 4, { fill: "none", stroke: "var(--pick)", "stroke-width": 1.5,
        "vector-effect": "non-scaling-stroke" }));
    }
    dot.append(circle(last.at, 5.5, { fill: "var(--pick)", stroke: "#fff", "stroke-width": 1.5,
      "vector-effect": "non-scaling-stroke" }));
  };
  const place = (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(root.getScreenCTM().inverse());
    return [point.x, point.y];
  };
  let drag = null;
  root.addEventListener("pointerdown", (event) => {
    drag = { from: place(event), client: [event.clientX, event.clientY], moved: false };
    root.setPointerCapture(event.pointerId);
  });
  root.addEventListener("pointermove", (event) => {
    if (!drag) return;
    const gone = Math.hypot(event.clientX - drag.client[0], event.clientY - drag.client[1]);
    drag.moved = drag.moved || gone > 4;
    if (!drag.moved) return;
    const at = place(event);
    const dx = drag.from[0] - at[0], dy = drag.from[1] - at[1];
    frame = [frame[0] + dx, frame[1] + dy, frame[2] + dx, frame[3] + dy];
    show();
  });
  root.addEventListener("pointerup", (event) => {
    if (drag && !drag.moved) onPick(nearest(projected, place(event)));
    drag = null;
  });
  root.addEventListener("wheel", (event) => {
    event.preventDefault();
    const [x, y] = place(event);
    const factor = Math.exp(event.deltaY * 0.0015);
    const zoomed = scale() * factor;
    if (zoomed < 1.6 && zoomed > 0.02) {
      frame = [x + (frame[0] - x) * factor, y + (frame[1] - y) * factor,
               x + (frame[2] - x) * factor, y + (frame[3] - y) * factor];
    }
    show();
    redraw();
  }, { passive: false });
  root.addEventListener("dblclick", () => {
    frame = frame.every((v, k) => v === body[k]) ? [...box] : [...body];
    show();
    redraw();
  });
  show();
  return {
    pick(at, epipolar, others) {
      const ends = epipolar && clip(epipolar, box);
      line.setAttribute("d", ends ? path(ends) : "");
      last = { at, others };
      redraw();
    },
    rival(points) { rival.setAttribute("d", points ? path(points) : ""); },
    mark(points) { markList = points; redraw(); },
  };
}
