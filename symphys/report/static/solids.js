// Solids: all points within `radius` of the convex hull of `corners`. Comes after geometry.js.

const UNIT = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const back = (n) => n.map((x) => -x);

function place(solid, pose, colour, fixed) { // a solid of the data where a pose puts it: centre, corners from there
  const own = (v) => turn(pose.q, solid.q ? turn(solid.q, v) : v);
  const corners = triples(solid.corners || [0, 0, 0]).map(own), centre = sum(pose.p, turn(pose.q, solid.centre), 1);
  const faces = (solid.faces || []).map((loop, f) => {
    const around = loop.map((k) => corners[k]);
    return { corners: around.map((c) => sum(centre, c, 1)), normal: facing(around), smooth: solid.smooth && solid.smooth[f] };
  });
  return {
    centre, radius: solid.radius, colour, fixed, corners, faces, axes: UNIT.map(own),
    reach: solid.radius + Math.max(...corners.map((c) => Math.hypot(...c))),
    kind: !solid.corners ? "ball" : solid.faces ? "polytope" : "capsule",
  };
}

function facing(polygon) { // the unit normal of a polygon, to the side from which it is counter-clockwise
  const arms = polygon.slice(1).map((c) => sum(c, polygon[0], -1));
  const area = arms.slice(1).reduce((n, arm, k) => sum(n, cross(arms[k], arm), 1), [0, 0, 0]), size = Math.hypot(...area);
  return area.map((x) => x / (size || 1));
}

function support(solid, n) { // how far it goes from its centre in a direction of length 1
  return solid.corners.reduce((far, c) => Math.max(far, dot(c, n)), -Infinity) + solid.radius;
}

function convex(points, radius) { // corners of the hull of points [x, y], counter-clockwise (Andrew 1979); two for a line
  const along = [...points].sort((p, q) => p[0] - q[0]), heights = points.map((p) => p[1]);
  const extent = Math.max(along[along.length - 1][0] - along[0][0], Math.max(...heights) - Math.min(...heights));
  const size = Math.max(extent, radius);
  if (extent <= 1e-9 * size) return [points[0]];
  let column = 0; // rounding must not order points that are one above the other
  const columns = along.map((p, i) => ({ p, column: i && p[0] - along[i - 1][0] > 1e-9 * size ? ++column : column }));
  const order = columns.sort((a, b) => a.column - b.column || a.p[1] - b.p[1]).map(({ p }) => p);
  const turns = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 1e-9 * size * size;
  const chain = (list) => {
    const kept = [];
    for (const c of list) {
      while (kept.length > 1 && !turns(kept[kept.length - 2], kept[kept.length - 1], c)) kept.pop();
      kept.push(c);
    }
    return kept.slice(0, -1);
  };
  return [...chain(order), ...chain(order.reverse())];
}

function outline(points, radius) { // counter-clockwise, around all within a radius of the convex hull of projected corners
  const hull = convex(points, radius), before = (i) => hull[(i || hull.length) - 1];
  if (hull.length === 1) return arc(hull[0], radius, 0, 2 * Math.PI);
  const angles = hull.map((p, i) => Math.atan2(before(i)[0] - p[0], p[1] - before(i)[1])); // each edge faces this way
  return hull.flatMap((p, i) => {
    const next = angles[(i + 1) % angles.length];
    return radius ? arc(p, radius, angles[i], next < angles[i] ? next + 2 * Math.PI : next) : [p];
  });
}

function arc(middle, radius, from, to) {
  const pieces = Math.max(1, Math.ceil((to - from) / (Math.PI / 16)));
  return Array.from({ length: pieces + 1 }, (_, i) => from + (to - from) * i / pieces)
    .map((t) => [middle[0] + radius * Math.cos(t), middle[1] + radius * Math.sin(t)]);
}

function extremes(solid) { // opposite corners of a box around it, square to the world's axes
  return [1, -1].map((sign) => solid.centre.map((x, k) => x + sign * support(solid, UNIT[k].map((u) => sign * u))));
}

function axis(capsule) { // of length 1, from its first to its second corner
  const [a, b] = capsule.corners, d = sum(b, a, -1), length = Math.hypot(...d);
  return d.map((x) => x / length);
}

function apart(a, b) { // the direction from a to b in which they are farthest from each other
  const d = sum(b.centre, a.centre, -1), list = [d];
  for (const s of [a, b]) {
    list.push(...s.faces.map((face) => face.normal));
    if (s.kind === "capsule") list.push(sum(d, axis(s), -dot(d, axis(s))));
  }
  let best = { gap: -Infinity, n: d };
  for (const v of list) {
    const length = Math.hypot(...v), along = dot(v, d) < 0 ? -1 : 1;
    if (length < 1e-12) continue;
    const n = v.map((x) => along * x / length), gap = dot(n, d) - support(a, n) - support(b, back(n));
    if (gap > best.gap) best = { gap, n };
  }
  return best.n;
}

function overlap(a, b, eye) { // whether two solids may cover each other: their shadows on lines across the picture meet
  const d = sum(a.centre, b.centre, -1);
  return [[1, 0], [0, 1], [0.6, 0.8], [0.6, -0.8], [0.8, 0.6], [0.8, -0.6]].every(([s, t]) => {
    const n = sum(eye.right.map((x) => s * x), eye.up, t), m = back(n), way = dot(d, n);
    return way < support(b, n) + support(a, m) && -way < support(b, m) + support(a, n);
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
  const w = axis(capsule), [x, y] = capsule.axes, beside = Math.abs(dot(x, w)) < 0.9 ? x : y;
  const across = sum(beside, w, -dot(beside, w)), u = across.map((c) => c / Math.hypot(...across)), v = cross(w, u);
  const loop = Array.from({ length: 49 }, (_, i) => [Math.cos(i * Math.PI / 24), Math.sin(i * Math.PI / 24)]);
  const at = (n, end) => ({ n, p: sum(sum(capsule.centre, capsule.corners[end], 1), n, capsule.radius) });
  const ends = [1, 0].map((end) => loop.map(([c, s]) => at(sum(u.map((x) => c * x), v, s), end)));
  const along = [u, v].map((side) => loop.map(([c, s]) => at(sum(side.map((x) => c * x), w, s), s < 0 ? 0 : 1)));
  return [...ends, ...along];
}
