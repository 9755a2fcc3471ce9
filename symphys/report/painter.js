// Draws one picture of the scene on a canvas. Comes after geometry.js.

const INK = "#5c6b78", GRID = "#dfe5ea", PLANE = "#f1f4f6", EDGE = "#aab5bf", GUESS = "#98a4af";

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

  drawShadows(ball, patches) {
    for (const { plane } of patches) {
      const n = plane.normal, height = dot(ball.centre, n) - plane.offset;
      if (n[2] < 0.5 || height < 0 || ball.radius === 0 || dot(n, this.eye.front) < 0.02) continue;
      const foot = sum(ball.centre, n, -height);
      const across = cross(n, Math.abs(n[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
      const u = across.map((x) => x * ball.radius / Math.hypot(...across)), v = cross(n, u);
      this.trace(this.rings[0].map((c) => sum(sum(foot, u, c[0]), v, c[1])));
      this.pen.fillStyle = "#1f2d3a";
      this.pen.globalAlpha = 0.04 + 0.16 * Math.exp(-(height - ball.radius) / (2 * ball.radius));
      this.pen.fill();
      this.pen.globalAlpha = 1;
    }
  }

  drawBall(ball) {
    const pen = this.pen, [x, y] = this.place(ball.centre), r = Math.max(ball.radius * this.scale, 4);
    const shade = pen.createRadialGradient(x - 0.35 * r, y - 0.4 * r, 0.1 * r, x, y, r);
    shade.addColorStop(0, mix(ball.colour, "#ffffff", 0.55));
    shade.addColorStop(1, ball.colour);
    pen.beginPath();
    pen.arc(x, y, r, 0, 2 * Math.PI);
    pen.fillStyle = shade;
    pen.fill();
    if (ball.radius > 0 && r > 5) this.drawRings(ball, x, y, r);
    pen.beginPath();
    pen.arc(x, y, r, 0, 2 * Math.PI);
    pen.strokeStyle = mix(ball.colour, "#000000", 0.25);
    pen.lineWidth = 1;
    pen.stroke();
  }

  drawRings(ball, x, y, r) { // the visible halves of three great circles show how the body turns
    const pen = this.pen;
    pen.strokeStyle = "rgba(255,255,255,0.9)";
    pen.lineWidth = Math.min(3, Math.max(1, r * 0.07));
    pen.beginPath();
    for (const ring of this.rings) {
      let on = false;
      for (const point of ring) {
        const p = turn(ball.q, point);
        if (dot(p, this.eye.front) < 0) { on = false; continue; }
        const px = x + r * dot(p, this.eye.right), py = y - r * dot(p, this.eye.up);
        if (on) pen.lineTo(px, py); else pen.moveTo(px, py);
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
