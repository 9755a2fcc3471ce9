// Terrain: a mesh of heights, cut where other ground hides it. Comes after geometry.js.

const LIGHT = [-0.45, -0.35, 0.82]; // of length 1, towards where light comes from

function mesh(terrain, planes) { // the cells of the mesh as polygons, with their normals
  const { x, y, z } = terrain, cells = [];
  const at = (i, j) => [x[i], y[j], z[j * x.length + i]];
  for (let j = 0; j + 1 < y.length; j++) {
    for (let i = 0; i + 1 < x.length; i++) {
      const corners = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
      if (corners.some((c) => c[2] === null)) continue;
      const normal = cross(sum(corners[2], corners[0], -1), sum(corners[3], corners[1], -1));
      const length = Math.hypot(...normal), polygon = clip(corners, planes);
      const width = Math.hypot(...sum(corners[2], corners[0], -1));
      if (polygon.length > 2) cells.push({ polygon, width, normal: normal.map((c) => c / length) });
    }
  }
  return cells;
}

function rim(terrain) { // the points on the edges of the mesh
  const { x, y, z } = terrain, last = [x.length - 1, y.length - 1], points = [];
  for (let j = 0; j < y.length; j++) {
    for (let i = 0; i < x.length; i++) {
      const height = z[j * x.length + i];
      if ((i === 0 || j === 0 || i === last[0] || j === last[1]) && height !== null) points.push([x[i], y[j], height]);
    }
  }
  return points;
}

function heightAt({ x, y, z }, px, py) { // between the heights of a cell; null beside the mesh
  const cell = (side, at) => Math.floor((at - side[0]) / (side[side.length - 1] - side[0]) * (side.length - 1));
  const i = cell(x, px), j = cell(y, py);
  if (!(i >= 0 && j >= 0 && i + 1 < x.length && j + 1 < y.length)) return null;
  const s = (px - x[i]) / (x[i + 1] - x[i]), t = (py - y[j]) / (y[j + 1] - y[j]), at = (k, l) => z[l * x.length + k];
  if ([at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)].includes(null)) return null;
  return (1 - t) * ((1 - s) * at(i, j) + s * at(i + 1, j)) + t * ((1 - s) * at(i, j + 1) + s * at(i + 1, j + 1));
}

function shadow(terrain, solid) { // what a solid hides from above, and how high above it is; null for none
  const foot = heightAt(terrain, solid.centre[0], solid.centre[1]), height = solid.centre[2] - foot;
  if (foot === null || height < 0 || solid.reach === 0) return null;
  const [x, y] = solid.centre, around = outline(solid.corners.map((c) => c.slice(0, 2)), solid.radius);
  const points = around.map(([a, b]) => [x + a, y + b, heightAt(terrain, x + a, y + b)]);
  return points.some((p) => p[2] === null) ? null : { points, height };
}

function shaded(normal) { // a grey by how much light falls on it
  const light = Math.max(0, dot(normal, LIGHT));
  return mix("#8a9bab", "#f4f7f9", Math.min(1, 1.15 * Math.pow(light, 1.6)));
}
