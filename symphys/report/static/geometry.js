// Vectors, the camera, and the shapes that are drawn: no libraries, nothing loaded. Comes before painter.js.
"use strict";

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const sum = (a, b, s) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];

function turn(q, p) { // unit quaternion w x y z
  const v = [q[1], q[2], q[3]];
  const c = cross(v, p).map((x) => 2 * x);
  return sum(sum(p, c, q[0]), cross(v, c), 1);
}

function camera(azimuth, elevation) { // orthonormal: right, up, towards the viewer
  const ca = Math.cos(azimuth), sa = Math.sin(azimuth), ce = Math.cos(elevation), se = Math.sin(elevation);
  return { right: [-sa, ca, 0], up: [-se * ca, -se * sa, ce], front: [ce * ca, ce * sa, se] };
}

function reach(body) { // from the body's centre to its farthest point
  return Math.max(...body.solids.map((s) => {
    const far = triples(s.corners || []).map((c) => Math.hypot(...c));
    return s.radius + Math.hypot(...s.centre) + Math.max(0, ...far);
  }));
}

function bounds(data) { // box around all bodies at all frames
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const count = data.bodies.length, radii = data.bodies.map(reach);
  triples(data.position).forEach((point, i) => point.forEach((x, k) => {
    low[k] = Math.min(low[k], x - radii[i % count]);
    high[k] = Math.max(high[k], x + radii[i % count]);
  }));
  const size = Math.max(Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]), 1e-9);
  return { low, high, size };
}

function widened(box, points) { // the box with what is near it of a set of points: a large thing counts to its near end
  const near = 0.35 * box.size, low = [...box.low], high = [...box.high];
  for (const p of points) {
    [0, 1, 2].forEach((k) => {
      low[k] = Math.min(low[k], Math.max(p[k], box.low[k] - near));
      high[k] = Math.max(high[k], Math.min(p[k], box.high[k] + near));
    });
  }
  return { low, high, size: box.size };
}

function mustSee(data, patches, box, more) { // points, each with a radius: some of every path, planes, and what is near
  const count = data.bodies.length, radii = data.bodies.map(reach), every = Math.ceil(data.position.length / 1500);
  const along = triples(data.position).map((point, i) => ({ point, radius: radii[i % count] }));
  const some = along.filter((_, i) => Math.floor(i / count) % every === 0 || i >= along.length - count);
  const limited = more.map((p) => p.map((x, k) => Math.min(box.high[k], Math.max(box.low[k], x))));
  return [...some, ...[...patches.flatMap((p) => p.quad), ...limited].map((point) => ({ point, radius: 0 }))];
}

function corners(box, pad) {
  const list = [];
  for (let i = 0; i < 8; i++) {
    list.push([0, 1, 2].map((k) => ((i >> k) & 1 ? box.high[k] + pad : box.low[k] - pad)));
  }
  return list;
}

function niceStep(length) {
  const ten = Math.pow(10, Math.floor(Math.log10(length)));
  return [1, 2, 5, 10].map((m) => m * ten).find((s) => s >= length);
}

function enclose(box, planes) { // the box, widened to planes that stand near and square to it
  const low = [...box.low], high = [...box.high], near = 0.5 * box.size;
  for (const { normal, offset } of planes) {
    const k = normal.findIndex((x) => Math.abs(x) > 0.99);
    if (k < 0) continue;
    const at = offset / normal[k];
    if (normal[k] > 0 && at > box.low[k] - near) low[k] = Math.min(low[k], at);
    if (normal[k] < 0 && at < box.high[k] + near) high[k] = Math.max(high[k], at);
  }
  return { low, high, size: box.size };
}

function clip(points, planes) { // the part of a polygon or segment outside all solids (Sutherland and Hodgman 1974)
  return planes.reduce((polygon, { normal, offset }) => polygon.flatMap((p, i) => {
    const q = polygon[(i + 1) % polygon.length];
    const dp = dot(p, normal) - offset, dq = dot(q, normal) - offset;
    const cut = sum(p, sum(q, p, -1), dp / (dp - dq));
    return (dp >= 0) === (dq >= 0) ? (dp >= 0 ? [p] : []) : (dp >= 0 ? [p, cut] : [cut]);
  }), points);
}

function patch(plane, others, box) { // the free part of a plane near the motion, with grid lines; null if far away
  const n = plane.normal, pad = 0.06 * box.size, around = corners(box, pad);
  const range = (d) => around.map((c) => dot(c, d)).reduce((a, x) => [Math.min(a[0], x), Math.max(a[1], x)], [Infinity, -Infinity]);
  const away = range(n);
  if (plane.offset < away[0] - pad || plane.offset > away[1] + pad) return null;
  const most = [0, 1, 2].reduce((a, k) => (Math.abs(n[k]) > Math.abs(n[a]) ? k : a), 0);
  const axis = [0, 0, 0];
  axis[(most + 1) % 3] = 1;
  const across = sum(axis, n, -dot(axis, n)), u = across.map((x) => x / Math.hypot(...across)), v = cross(n, u);
  const at = (a, b) => sum(sum(n.map((x) => x * plane.offset), u, a), v, b);
  const ru = range(u), rv = range(v), step = niceStep(box.size / 14), lines = [];
  for (let a = Math.ceil(ru[0] / step) * step; a < ru[1]; a += step) lines.push([at(a, rv[0]), at(a, rv[1])]);
  for (let b = Math.ceil(rv[0] / step) * step; b < rv[1]; b += step) lines.push([at(ru[0], b), at(ru[1], b)]);
  const quad = clip([at(ru[0], rv[0]), at(ru[1], rv[0]), at(ru[1], rv[1]), at(ru[0], rv[1])], others);
  return { plane, quad, lines: lines.map((line) => clip(line, others)).filter((line) => line.length > 1) };
}

function circles() { // three great circles of the unit sphere, body frame
  const loop = (f) => Array.from({ length: 37 }, (_, i) => f(Math.cos(i * Math.PI / 18), Math.sin(i * Math.PI / 18)));
  return [loop((c, s) => [c, s, 0]), loop((c, s) => [c, 0, s]), loop((c, s) => [0, c, s])];
}

function mix(colour, other, share) {
  const read = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
  const a = read(colour), b = read(other);
  return `rgb(${a.map((x, i) => Math.round(x + share * (b[i] - x))).join(",")})`;
}

function triples(flat) {
  return Array.from({ length: flat.length / 3 }, (_, i) => flat.slice(3 * i, 3 * i + 3));
}
