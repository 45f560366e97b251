// Small helpers that only ever set text, never markup: what comes from files stays inert.
export const byId = (id) => document.getElementById(id);

export function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

const SVG = "http://www.w3.org/2000/svg";

export function svg(tag, attributes = {}, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.append(...children);
  return node;
}

export const path = (points) =>
  points.map(([x, y], i) => `${i ? "L" : "M"}${x.toFixed(2)} ${y.toFixed(2)}`).join("");

export function number(value, digits = 3) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  if (Number.isInteger(value) && Math.abs(value) < 1e9) return String(value);
  const magnitude = Math.floor(Math.log10(Math.abs(value)));
  if (magnitude < -4) return value.toExponential(1);
  return value.toFixed(Math.min(6, Math.max(0, digits - 1 - magnitude)));
}

export function keyTable(table, rows) {
  for (const [key, value] of rows) {
    table.append(element("tr", {}, element("td", {}, key), element("td", {}, String(value))));
  }
}

// A perceptually even ramp from blue to yellow (the ends and middle of cividis).
export function ramp(t) {
  const stops = [[0, 45, 115], [86, 92, 108], [165, 151, 116], [254, 232, 56]];
  const x = Math.min(0.9999, Math.max(0, t)) * 3;
  const k = Math.floor(x), f = x - k;
  return stops[k].map((v, c) => Math.round(v + (stops[k + 1][c] - v) * f));
}
