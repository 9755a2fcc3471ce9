// Draws one picture of the scene on a canvas. Comes after solids.js and terrain.js.

const INK = "#5c6b78", GRID = "#dfe5ea", PLANE = "#f1f4f6", EDGE = "#aab5bf", GUESS = "#98a4af", FIXED = "#b7c2cc", DARK = "#1f2d3a";

class Painter {
  constructor(canvas, axes) {
    this.canvas = canvas;
    this.axes = axes; // colours of x, y, z
    this.rings = circles();
  }

  fit(seen, azimuth, elevation) { // seen: points that must be seen, each with the radius around it
    const ratio = window.devicePixelRatio || 1, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    this.eye = camera(azimuth, elevation);
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const { point, radius } of seen) {
      [dot(point, this.eye.right), dot(point, this.eye.up)].forEach((x, k) => {
        low[k] = Math.min(low[k], x - radius);
        high[k] = Math.max(high[k], x + radius);
      });
    }
    this.scale = Math.min((width - 48) / (high[0] - low[0] || 1), (height - 48) / (high[1] - low[1] || 1));
    this.middle = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    this.pen = this.canvas.getContext("2d");
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.clearRect(0, 0, width, height);
    this.size = [width, height];
  }

  place(point) {
    return [
      this.size[0] / 2 + (dot(point, this.eye.right) - this.middle[0]) * this.scale,
      this.size[1] / 2 - (dot(point, this.eye.up) - this.middle[1]) * this.scale,
    ];
  }

  depth(point) { return dot(point, this.eye.front); }

  trace(points) {
    this.pen.beginPath();
    points.forEach((p, i) => {
      const [x, y] = this.place(p);
      if (i) this.pen.lineTo(x, y); else this.pen.moveTo(x, y);
    });
  }

  line(points, colour, width, alpha = 1, dash = []) {
    const pen = this.pen;
    this.trace(points);
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.globalAlpha = alpha;
    pen.setLineDash(dash);
    pen.stroke();
    pen.globalAlpha = 1;
    pen.setLineDash([]);
  }

  drawPlane(p) {
    const facing = dot(p.plane.normal, this.eye.front);
    if (facing > 0.02) {
      this.trace(p.quad);
      this.pen.fillStyle = PLANE;
      this.pen.fill();
      p.lines.forEach((l) => this.line(l, GRID, 1));
    }
    this.line([...p.quad, p.quad[0]], EDGE, facing > 0.02 ? 1 : 1.5, facing < -0.02 ? 0.35 : 1);
  }

  drawGuess(path) { this.line(path, GUESS, 1, 0.9, [5, 4]); }

  drawPath(path, index, colour) { // all of it pale, what is over strong
    this.line(path, colour, 1, 0.22);
    this.line(path.slice(0, index + 1), colour, 1.6, 0.75);
  }

  drawCell(cell) { // of terrain
    this.trace(cell.polygon);
    this.pen.closePath();
    this.pen.fillStyle = shaded(cell.normal);
    this.pen.fill();
    this.pen.strokeStyle = "rgba(125,140,155,0.28)";
    this.pen.lineWidth = 0.7;
    this.pen.stroke();
  }

  drawShadows(solid, patches, terrain) { // straight down
    for (const ground of terrain) {
      const found = shadow(ground, solid);
      if (found) this.drawShadow(found.points, found.height, support(solid, [0, 0, -1]));
    }
    for (const { plane } of patches) {
      const n = plane.normal, height = dot(solid.centre, n) - plane.offset;
      if (n[2] < 0.5 || height < 0 || solid.reach === 0 || dot(n, this.eye.front) < 0.02) continue;
      const foot = sum(solid.centre, n, -height);
      const across = cross(n, Math.abs(n[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
      const u = across.map((x) => x / Math.hypot(...across)), v = cross(n, u);
      const around = outline(solid.corners.map((c) => [dot(c, u), dot(c, v)]), solid.radius);
      this.drawShadow(around.map((c) => sum(sum(foot, u, c[0]), v, c[1])), height, support(solid, back(n)));
    }
  }

  drawShadow(points, height, below) { // paler the higher the solid is, that reaches so far below its centre
    this.trace(points);
    this.pen.fillStyle = DARK;
    this.pen.globalAlpha = 0.04 + 0.16 * Math.exp(-Math.max(0, height - below) / (2 * below));
    this.pen.fill();
    this.pen.globalAlpha = 1;
  }

  drawSolid(solid, planes) {
    const draw = { ball: "drawBall", capsule: "drawCapsule", polytope: "drawPolytope" }[solid.kind];
    this[draw](solid, planes);
  }

  drawBall(ball, planes) {
    const pen = this.pen, [x, y] = this.place(ball.centre), r = Math.max(ball.radius * this.scale, 4);
    const shade = pen.createRadialGradient(x - 0.35 * r, y - 0.4 * r, 0.1 * r, x, y, r);
    shade.addColorStop(0, mix(ball.colour, "#ffffff", 0.55));
    shade.addColorStop(1, ball.colour);
    const trace = () => {
      if (ball.fixed) { this.trace(this.silhouette(ball, planes)); pen.closePath(); return; }
      pen.beginPath();
      pen.arc(x, y, r, 0, 2 * Math.PI);
    };
    trace();
    pen.fillStyle = shade;
    pen.fill();
    if (ball.radius > 0 && r > 5 && !ball.fixed) this.drawLines(this.rings.map((ring) => onBall(ring, ball)), r);
    trace();
    this.edge(ball.colour);
  }

  drawCapsule(capsule, planes) {
    const pen = this.pen, [x, y] = this.place(capsule.centre), r = capsule.radius * this.scale;
    const end = capsule.corners[1], ax = dot(end, this.eye.right), ay = -dot(end, this.eye.up), length = Math.hypot(ax, ay);
    const side = length > 1e-9 * capsule.reach ? [-ay / length, ax / length] : [0, 1];
    const sign = side[1] < 0 || (side[1] === 0 && side[0] < 0) ? -r : r, far = side.map((c) => sign * c);
    const shade = pen.createLinearGradient(x - far[0], y - far[1], x + far[0], y + far[1]);
    [[0, 0.15], [0.3, 0.55], [1, 0]].forEach(([at, white]) => shade.addColorStop(at, mix(capsule.colour, "#ffffff", white)));
    const around = this.silhouette(capsule, planes);
    this.trace(around);
    pen.closePath();
    pen.fillStyle = shade;
    pen.fill();
    if (r > 4 && !capsule.fixed) this.drawLines(stadium(capsule), r);
    this.trace(around);
    pen.closePath();
    this.edge(capsule.colour);
  }

  silhouette(solid, planes) { // around what is seen, in the plane of its centre; of what stands still, what is above ground
    const { right, up } = this.eye;
    const points = outline(solid.corners.map((c) => [dot(c, right), dot(c, up)]), solid.radius);
    const around = points.map(([a, b]) => sum(sum(solid.centre, right, a), up, b));
    return solid.fixed ? clip(around, planes) : around;
  }

  within(solid, draw) { // draw over a solid and its edge, and nothing else
    const pen = this.pen;
    pen.save();
    this.trace(this.silhouette({ ...solid, fixed: false, radius: solid.radius + 1.5 / this.scale }, []));
    pen.clip();
    draw();
    pen.restore();
  }

  drawPolytope(solid, planes) { // the faces that are seen; if it is rounded, as far out as the radius, inside its outline
    const pen = this.pen, { radius } = solid, around = radius ? this.silhouette(solid, planes) : [];
    pen.lineJoin = "round";
    if (radius) this.fill(around, mix(solid.colour, "#ffffff", 0.08));
    for (const { corners, normal, smooth } of solid.faces.filter((face) => this.sees(face))) {
      const flat = radius ? corners.map((c) => sum(c, normal, radius)) : corners;
      const polygon = solid.fixed ? clip(flat, planes) : flat;
      if (polygon.length < 3) continue;
      this.fill(polygon, mix(solid.colour, "#ffffff", 0.08 + 0.5 * Math.max(0, dot(normal, LIGHT))));
      if (!radius && !smooth) this.edge(solid.colour);
      if (!radius && smooth) this.drawEdges(solid, corners, smooth, planes);
    }
    if (!radius) return;
    this.trace(around);
    pen.closePath();
    this.edge(solid.colour);
  }

  sees(face) { return dot(face.normal, this.eye.front) > 1e-6; }

  fill(polygon, colour) {
    this.trace(polygon);
    this.pen.closePath();
    this.pen.fillStyle = colour;
    this.pen.fill();
  }

  drawEdges(solid, corners, smooth, planes) { // of a face; where the surface goes on smoothly, only at the outline
    const pen = this.pen;
    pen.strokeStyle = pen.fillStyle; // so that no line stays free between faces
    pen.lineWidth = 1;
    pen.stroke();
    pen.lineCap = "round";
    corners.forEach((corner, k) => {
      if (smooth[k] >= 0 && this.sees(solid.faces[smooth[k]])) return;
      const line = [corner, corners[(k + 1) % corners.length]];
      this.trace(solid.fixed ? clip(line, planes) : line);
      this.edge(solid.colour);
    });
    pen.lineCap = "butt";
  }

  edge(colour) {
    this.pen.strokeStyle = mix(colour, "#000000", 0.25);
    this.pen.lineWidth = 1;
    this.pen.stroke();
  }

  drawLines(loops, r) { // what is visible of lines on a surface shows how the body turns: points p with normals n
    const pen = this.pen;
    pen.strokeStyle = "rgba(255,255,255,0.9)";
    pen.lineWidth = Math.min(3, Math.max(1, r * 0.07));
    pen.beginPath();
    for (const loop of loops) {
      let on = false;
      for (const { n, p } of loop) {
        if (dot(n, this.eye.front) < 0) { on = false; continue; }
        const [x, y] = this.place(p);
        if (on) pen.lineTo(x, y); else pen.moveTo(x, y);
        on = true;
      }
    }
    pen.stroke();
  }

  drawTriad() {
    const pen = this.pen, x = 34, y = this.size[1] - 34;
    pen.font = "600 11px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    ["x", "y", "z"].forEach((name, k) => {
      const dx = this.eye.right[k], dy = -this.eye.up[k];
      if (Math.hypot(dx, dy) < 0.15) return;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 18 * dx, y + 18 * dy);
      pen.strokeStyle = this.axes[k];
      pen.lineWidth = 2;
      pen.stroke();
      pen.fillStyle = INK;
      pen.fillText(name, x + 27 * dx, y + 27 * dy);
    });
  }
}
