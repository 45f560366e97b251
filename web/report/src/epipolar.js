// Two-view geometry of the page: F with p1' F p2 = 0, rows first.
export const lineIn1 = (f, [x, y]) => f.map((row) => row[0] * x + row[1] * y + row[2]);
export const lineIn2 = (f, [x, y]) => [0, 1, 2].map((c) => f[0][c] * x + f[1][c] * y + f[2][c]);

export const distance = ([a, b, c], [x, y]) => Math.abs(a * x + b * y + c) / Math.hypot(a, b);

// The part of a line within a box, as two points, or null.
export function clip([a, b, c], [left, top, right, bottom]) {
  const hits = [];
  if (b !== 0) for (const x of [left, right]) hits.push([x, -(a * x + c) / b]);
  if (a !== 0) for (const y of [top, bottom]) hits.push([-(b * y + c) / a, y]);
  const slack = 1e-6 * (right - left + bottom - top);
  const inside = hits.filter(([x, y]) =>
    x >= left - slack && x <= right + slack && y >= top - slack && y <= bottom + slack);
  let best = null, far = 0;
  for (const p of inside) for (const q of inside) {
    const d = Math.hypot(p[0] - q[0], p[1] - q[1]);
    if (d > far) { far = d; best = [p, q]; }
  }
  return best;
}

// Where a line meets an ordered curve: indices of the points next to each crossing.
export function crossings([a, b, c], curve) {
  const found = [];
  const norm = Math.hypot(a, b);
  const signed = (p) => (a * p[0] + b * p[1] + c) / norm;
  for (let j = 0; j + 1 < curve.length; j++) {
    const s = signed(curve[j]), t = signed(curve[j + 1]);
    if (s === 0 || s * t < 0) {
      const w = s / (s - t || 1);
      found.push({
        j: j + (Math.abs(t) < Math.abs(s) ? 1 : 0),
        at: [curve[j][0] + w * (curve[j + 1][0] - curve[j][0]),
             curve[j][1] + w * (curve[j + 1][1] - curve[j][1])],
      });
    }
  }
  return found;
}

export function nearest(curve, [x, y]) {
  let best = 0, near = Infinity;
  curve.forEach((p, i) => {
    const d = (p[0] - x) ** 2 + (p[1] - y) ** 2;
    if (d < near) { near = d; best = i; }
  });
  return best;
}
