// Solids: all points within `radius` of an inner box, whose half axes are `half`. Comes after geometry.js.

const UNIT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];

function place(solid, pose, colour, fixed) { // a solid of the data where a pose puts it: centre, half axes in the world
  const own = (v) => turn(pose.q, solid.q ? turn(solid.q, v) : v);
  const axes = UNIT.map(own), size = solid.half || [0, 0, 0];
  return {
    centre: sum(pose.p, turn(pose.q, solid.centre), 1), radius: solid.radius, colour, fixed, axes, size,
    half: axes.map((a, k) => a.map((x) => x * size[k])), girth: solid.radius || Math.min(...size),
    reach: solid.radius + Math.hypot(...size), kind: !solid.half ? "ball" : solid.radius ? "capsule" : "box",
  };
}

function support(solid, n) { // how far it goes from its centre in a direction of length 1
  return solid.half.reduce((far, a) => far + Math.abs(dot(a, n)), solid.radius);
}

function outline(sides, radius) { // counter-clockwise points around a projected inner box, given its half axes [x, y]
  const least = 1e-9 * Math.max(radius, ...sides.map((s) => Math.hypot(...s)));
  const kept = sides.filter((s) => Math.hypot(...s) > least).map((s) => (s[1] > 0 || (s[1] === 0 && s[0] > 0) ? s : [-s[0], -s[1]]));
  if (!kept.length) return arc([0, 0], radius, 0, 2 * Math.PI);
  kept.sort((a, b) => Math.atan2(a[1], a[0]) - Math.atan2(b[1], b[0]));
  const edges = [...kept, ...kept.map((s) => [-s[0], -s[1]])], facing = edges.map((e) => Math.atan2(-e[0], e[1]));
  let corner = kept.reduce((c, s) => [c[0] - s[0], c[1] - s[1]], [0, 0]);
  return edges.flatMap((e, i) => {
    corner = [corner[0] + 2 * e[0], corner[1] + 2 * e[1]];
    const next = facing[(i + 1) % facing.length];
    return radius ? arc(corner, radius, facing[i], next < facing[i] ? next + 2 * Math.PI : next) : [corner];
  });
}

function arc(middle, radius, from, to) {
  const pieces = Math.max(1, Math.ceil((to - from) / (Math.PI / 16)));
  return Array.from({ length: pieces + 1 }, (_, i) => from + (to - from) * i / pieces)
    .map((t) => [middle[0] + radius * Math.cos(t), middle[1] + radius * Math.sin(t)]);
}

function faces(box) { // the six sides of a box: outward normal and corners
  return [0, 1, 2].flatMap((k) => [1, -1].map((sign) => {
    const a = box.half[(k + 1) % 3], b = box.half[(k + 2) % 3], middle = sum(box.centre, box.half[k], sign);
    const at = (s, t) => sum(sum(middle, a, s), b, t);
    return { normal: box.axes[k].map((x) => sign * x), corners: [at(1, 1), at(-1, 1), at(-1, -1), at(1, -1)] };
  }));
}

function extremes(solid) { // opposite corners of a box around it, square to the world's axes
  const size = UNIT.map((axis) => support(solid, axis));
  return [1, -1].map((sign) => solid.centre.map((x, k) => x + sign * size[k]));
}

function apart(a, b) { // the direction from a to b in which they are farthest from each other
  const d = sum(b.centre, a.centre, -1), list = [d];
  for (const s of [a, b]) {
    if (s.kind === "box") list.push(...s.axes);
    if (s.kind === "capsule") list.push(sum(d, s.axes[2], -dot(d, s.axes[2])));
  }
  let best = { gap: -Infinity, n: d };
  for (const v of list) {
    const length = Math.hypot(...v), along = dot(v, d) < 0 ? -1 : 1;
    if (length < 1e-12) continue;
    const n = v.map((x) => along * x / length), gap = dot(n, d) - support(a, n) - support(b, n);
    if (gap > best.gap) best = { gap, n };
  }
  return best.n;
}

function overlap(a, b, eye) { // whether two solids may cover each other: their shadows on lines across the picture meet
  const d = sum(a.centre, b.centre, -1);
  return [[1, 0], [0, 1], [0.6, 0.8], [0.6, -0.8], [0.8, 0.6], [0.8, -0.6]].every(([s, t]) => {
    const n = sum(eye.right.map((x) => s * x), eye.up, t);
    return Math.abs(dot(d, n)) < support(a, n) + support(b, n);
  });
}

function inOrder(solids, eye) { // from the back to the front: by planes between them, else by their centres
  const depth = (s) => dot(s.centre, eye.front), sorted = [...solids].sort((a, b) => depth(a) - depth(b));
  if (sorted.length > 90) return sorted;
  const done = new Set(), list = [];
  const covers = (i, j) => overlap(sorted[i], sorted[j], eye) && dot(apart(sorted[j], sorted[i]), eye.front) > 1e-3;
  const visit = (i) => {
    if (done.has(i)) return;
    done.add(i);
    for (let j = 0; j < sorted.length; j++) if (!done.has(j) && covers(i, j)) visit(j);
    list.push(sorted[i]);
  };
  sorted.forEach((_, i) => visit(i));
  return list;
}

function onBall(ring, ball) { // points of the unit sphere, as points on a ball with their normals
  return ring.map((point) => {
    const n = ball.axes.reduce((v, a, k) => sum(v, a, point[k]), [0, 0, 0]);
    return { n, p: sum(ball.centre, n, ball.radius) };
  });
}

function stadium(capsule) { // on a capsule: the circles where its ends begin, and two lines around along its axis
  const [u, v, w] = capsule.axes, loop = Array.from({ length: 49 }, (_, i) => [Math.cos(i * Math.PI / 24), Math.sin(i * Math.PI / 24)]);
  const at = (n, end) => ({ n, p: sum(sum(capsule.centre, capsule.half[2], end), n, capsule.radius) });
  const ends = [1, -1].map((end) => loop.map(([c, s]) => at(sum(u.map((x) => c * x), v, s), end)));
  const along = [u, v].map((side) => loop.map(([c, s]) => at(sum(side.map((x) => c * x), w, s), s < 0 ? -1 : 1)));
  return [...ends, ...along];
}
