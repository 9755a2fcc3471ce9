// Plays a recorded motion on a canvas: parallel projection, drag to turn. Comes after painter.js and joints.js.

const ends = (list) => [list[0], list[list.length - 1]];
const STILL = { p: [0, 0, 0], q: [1, 0, 0, 0] };
const LOW = 0.12; // below this elevation hills would hide what moves between them, so they stay behind it

class Player {
  constructor(root) {
    this.root = root;
    root.player = this; // for those who look at it from outside
    this.canvas = root.querySelector("canvas");
    this.button = root.querySelector(".play");
    [this.slider, this.output] = ["input", "output"].map((name) => root.querySelector(`.controls ${name}`));
    this.speed = root.querySelector("select");
    this.views = [...root.querySelectorAll("[data-view]")];
    this.follow = root.querySelector("[data-follow]");
    this.stage = window.stageOf ? window.stageOf(this.canvas) : null; // three dimensions, where there is WebGL
    this.others = new Map([...root.querySelectorAll("script[data-of]")].map((s) => [s.dataset.of, s]));
    this.playing = false;
    this.film = root.querySelector(".film");
    this.load(root.querySelector("script:not([data-film])"));
    const asked = Number(/[#&]t=([\d.]+)/.exec(window.location.hash)?.[1]); // an address may name a moment: #t=0.4
    this.time = Math.min(Math.max(asked || this.first, this.first), this.last);
    this.listen();
    if (this.film) this.watch();
    this.look(this.data.flat ? "top" : "space");
  }

  load(script) { // the motion that it plays
    this.data = JSON.parse(script.textContent);
    this.motion = this.data; // times, positions and orientations
    this.painter = this.stage ? null : new Painter(this.canvas, this.data.axes);
    this.following = Boolean(this.data.follow);
    this.fixtures = this.data.fixtures.map((solid) => place(solid, STILL, FIXED, true));
    this.cells = this.data.terrain.flatMap((terrain) => mesh(terrain, this.data.planes));
    const corners = this.fixtures.flatMap((solid) => extremes(solid)), edges = this.data.terrain.flatMap(rim);
    this.box = widened(bounds(this.data), [...corners, ...edges]);
    this.patches = this.visible(this.data.planes);
    this.paths = this.data.bodies.map((_, b) => this.path(b));
    this.guesses = this.data.guess.map((flat) => triples(flat));
    this.around = [...corners, ...edges];
    this.seen = mustSee(this.data, this.patches, this.box, this.around);
    [this.first, this.last] = ends(this.motion.time);
    this.stage?.load(this.data, this.box);
  }

  watch() { // the solve, from the guess to the solution
    const film = JSON.parse(this.film.querySelector("script").textContent), count = film.labels.length;
    const [play, slider, output] = ["button", "input", "output"].map((name) => this.film.querySelector(name));
    const whole = (k, name, size) => { // numbers of a motion, from their differences
      const found = film[name][k].map((x) => x), stride = size * this.data.bodies.length;
      for (let i = stride; i < found.length; i++) found[i] += found[i - stride];
      return found.map((x) => x * film[`${name}_unit`]);
    };
    const show = (k) => {
      const last = k === count - 1, share = (this.time - this.first) / (this.last - this.first || 1);
      this.motion = last ? this.data : { time: film.time[k], position: whole(k, "position", 3), orientation: whole(k, "orientation", 4) };
      [this.first, this.last] = ends(this.motion.time);
      this.time = this.first + share * (this.last - this.first);
      this.paths = this.data.bodies.map((_, b) => this.path(b));
      this.stage?.show(this.motion.position, last);
      output.textContent = film.labels[k];
      slider.value = String(k);
      this.draw();
      document.dispatchEvent(new CustomEvent("worked", { detail: last ? null : film.work[k] }));
    };
    let timer = null;
    const stop = () => { clearInterval(timer); timer = null; play.textContent = "▶ solve"; };
    slider.addEventListener("input", () => { stop(); show(Number(slider.value)); });
    play.addEventListener("click", () => {
      if (timer) { stop(); return; }
      let k = Number(slider.value) === count - 1 ? 0 : Number(slider.value);
      play.textContent = "❚❚ solve";
      show(k);
      timer = setInterval(() => { k += 1; show(Math.min(k, count - 1)); if (k >= count - 1) stop(); }, Math.max(80, 4000 / count));
    });
    output.textContent = film.labels[count - 1];
  }

  peek(target) { // the motion of the run whose page a link below the pointer leads to; beside it where it is out of sight
    const script = this.others.get(target.closest?.("a")?.getAttribute("href"));
    if (!script) return this.root.classList.remove("peek");
    const box = this.root.getBoundingClientRect();
    if (!this.root.classList.contains("peek") && (box.top > window.innerHeight - 120 || box.bottom < 120)) this.root.classList.add("peek");
    this.load(script);
    this.time = Math.min(Math.max(this.time, this.first), this.last);
    this.root.querySelector(".shown").textContent = script.dataset.title;
    this.draw();
  }

  visible(planes) {
    const box = enclose(this.box, planes);
    const patches = planes.map((plane) => patch(plane, planes.filter((other) => other !== plane), box));
    return patches.filter((found) => found && found.quad.length > 2);
  }

  listen() {
    this.button.addEventListener("click", () => this.toggle());
    this.slider.addEventListener("input", () => {
      this.pause();
      this.go(this.first + (this.slider.value / 1000) * (this.last - this.first));
    });
    document.addEventListener("moment", ({ detail: { time, from } }) => {
      if (time === null || from === this || this.playing) return;
      this.time = Math.min(Math.max(time, this.first), this.last);
      this.draw();
    });
    if (this.others.size) ["pointerover", "focusin"].forEach((kind) => document.addEventListener(kind, (e) => this.peek(e.target)));
    document.addEventListener("stretch", ({ detail }) => { // of time that is played over and over; null for all
      this.stretch = detail;
      if (detail) this.go(detail[0]);
    });
    this.views.forEach((b) => b.addEventListener("click", () => this.look(b.dataset.view)));
    this.follow?.addEventListener("click", () => {
      this.following = !this.following;
      this.follow.setAttribute("aria-pressed", String(this.following));
      if (this.stage) this.look(this.view); else this.draw();
    });
    this.canvas.addEventListener("keydown", (e) => {
      if (e.key === " ") { e.preventDefault(); this.toggle(); }
      const step = { ArrowLeft: -1, ArrowRight: 1 }[e.key];
      if (step) { e.preventDefault(); this.pause(); this.go(this.time + step * (this.last - this.first) / 100); }
    });
    if (this.stage) this.listenOnStage(); else this.listenOnCanvas();
    new ResizeObserver(() => { this.stage?.resize(); this.draw(); }).observe(this.canvas);
  }

  listenOnCanvas() {
    this.canvas.addEventListener("pointerdown", (e) => {
      this.grip = [e.clientX, e.clientY];
      this.canvas.setPointerCapture(e.pointerId);
    });
    this.canvas.addEventListener("pointerup", () => { this.grip = null; });
    this.canvas.addEventListener("pointermove", (e) => this.drag(e));
  }

  listenOnStage() {
    this.canvas.classList.add("stage");
    this.root.querySelectorAll("[data-stage]").forEach((each) => { each.hidden = false; });
    this.root.querySelector("[data-picture]").addEventListener("click", () => {
      const link = document.createElement("a");
      Object.assign(link, { href: this.stage.picture(), download: "motion.png" });
      link.click();
    });
    this.canvas.addEventListener("turned", () => this.mark(""));
    const again = () => { this.stage.load(this.data, this.box); this.draw(); }; // in other colours
    document.querySelectorAll(".theme input").forEach((input) => input.addEventListener("change", again));
    window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
    const still = document.createElement("img"); // on paper
    window.addEventListener("beforeprint", () => { still.src = this.stage.picture(); this.canvas.after(still); this.canvas.hidden = true; });
    window.addEventListener("afterprint", () => { still.remove(); this.canvas.hidden = false; });
  }

  look(name) {
    this.view = name;
    if (this.stage) {
      this.mark(name);
      this.draw();
      this.stage.look(name, this.surfaces());
      return;
    }
    const side = this.data.along === "y" ? 0 : -Math.PI / 2;
    const angles = { space: [side - 0.5, this.data.flat ? 0.9 : 0.38], side: [side, 0], top: [side, Math.PI / 2] };
    [this.azimuth, this.elevation] = angles[name];
    this.mark(name);
    this.draw();
  }

  surfaces() { // corners of all solids along the motion, each with its radius; of what the camera follows as seen from there
    const { data, motion } = this, frames = motion.time.length, every = Math.max(1, Math.floor(frames / 60)), points = [];
    const middle = (poses) => [0, 1].map((k) => data.follow.bodies.reduce((s, b) => s + poses[b].p[k], 0) / data.follow.bodies.length);
    const here = this.following ? middle(this.poses) : null;
    for (let i = 0; i < frames; i += every) {
      const poses = data.bodies.map((_, b) => this.pose(b, i, 0)), at = here && middle(poses);
      const shift = here ? [here[0] - at[0], here[1] - at[1], 0] : [0, 0, 0];
      data.bodies.forEach((body, b) => {
        if (here && !data.follow.bodies.includes(b)) return;
        points.push({ point: sum(poses[b].p, shift, 1), radius: 0 });
        for (const solid of body.solids) {
          const { centre, corners, radius } = place(solid, poses[b], body.colour, false);
          for (const corner of corners) points.push({ point: sum(sum(centre, corner, 1), shift, 1), radius });
        }
      });
    }
    if (here) return points;
    const middles = [0, 1, 2].map((k) => (this.box.low[k] + this.box.high[k]) / 2);
    const aims = data.marks.filter((m) => !m.limit && m.at.filter((x) => x === null).length < 2);
    const sunk = aims.map((m) => ({ point: m.at.map((x, k) => x ?? middles[k]), radius: m.tolerance }));
    const limited = this.around.map((p) => p.map((x, k) => Math.min(this.box.high[k], Math.max(this.box.low[k], x))));
    return [...points, ...sunk, ...limited.map((point) => ({ point, radius: 0 }))];
  }

  mark(name) { this.views.forEach((b) => b.setAttribute("aria-pressed", String(b.dataset.view === name))); }

  drag(event) {
    if (!this.grip) return;
    this.azimuth -= (event.clientX - this.grip[0]) * 0.008;
    this.elevation += (event.clientY - this.grip[1]) * 0.008;
    this.elevation = Math.min(Math.PI / 2, Math.max(0, this.elevation));
    this.grip = [event.clientX, event.clientY];
    this.mark("");
    this.draw();
  }

  go(time) { // there, and the curves too
    this.time = Math.min(Math.max(time, this.first), this.last);
    this.draw();
    moment(this.time, this);
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  pause() {
    this.playing = false;
    this.button.textContent = "▶";
  }

  play() {
    const [from, to] = this.stretch || [this.first, this.last];
    if (this.time >= to || this.time < from) this.time = from;
    this.playing = true;
    this.button.textContent = "❚❚";
    this.clock = performance.now();
    requestAnimationFrame((now) => this.advance(now));
  }

  advance(now) {
    if (!this.playing) return;
    this.time += Math.max(now - this.clock, 0) / 1000 * Number(this.speed.value);
    this.clock = now;
    if (this.stretch && this.time >= Math.min(this.stretch[1], this.last)) this.time = this.stretch[0];
    else if (this.time >= this.last) this.pause();
    this.go(this.time);
    if (this.playing) requestAnimationFrame((next) => this.advance(next));
  }

  frame() { // index of the frame before the time, and the share of the way to the next
    const t = this.motion.time;
    let a = 0, b = t.length - 1;
    while (b - a > 1) { const m = (a + b) >> 1; if (t[m] <= this.time) a = m; else b = m; }
    return [a, b > a && t[b] > t[a] ? Math.min(1, (this.time - t[a]) / (t[b] - t[a])) : 0];
  }

  pose(body, index, share) {
    const count = this.data.bodies.length, frames = this.motion.time.length;
    const read = (list, size, i) => list.slice((i * count + body) * size, (i * count + body + 1) * size);
    const next = Math.min(index + 1, frames - 1);
    const p = read(this.motion.position, 3, index), p1 = read(this.motion.position, 3, next);
    const q = read(this.motion.orientation, 4, index), q1 = read(this.motion.orientation, 4, next);
    const s = q.reduce((a, x, k) => a + x * q1[k], 0) < 0 ? -1 : 1;
    const mid = q.map((x, k) => x + share * (s * q1[k] - x)), size = Math.hypot(...mid) || 1;
    return { p: sum(p, sum(p1, p, -1), share), q: mid.map((x) => x / size) };
  }

  draw() {
    const [index, share] = this.frame(), poses = this.data.bodies.map((_, b) => this.pose(b, index, share));
    this.poses = poses;
    if (this.stage) this.stage.draw(poses, index, share, this.following); else this.paint(poses, index);
    this.output.textContent = `${this.time.toFixed(2)} / ${this.last.toFixed(2)} s`;
    this.slider.value = String(Math.round(1000 * (this.time - this.first) / (this.last - this.first || 1)));
  }

  paint(poses, index) {
    const painter = this.painter, data = this.data, solids = this.solids(poses);
    painter.fit(this.following ? alongside(data.follow, poses) : this.seen, this.azimuth, this.elevation);
    this.patches.forEach((p) => painter.drawPlane(p));
    const cells = this.inDepth();
    cells.forEach(({ cell }) => painter.drawCell(cell));
    solids.forEach((solid) => painter.drawShadows(solid, this.patches, this.data.terrain));
    this.drawFixtures(cells);
    this.guesses.forEach((path) => painter.drawGuess(path));
    this.paths.forEach((path, b) => { if (data.bodies[b].path) painter.drawPath(path, index, data.bodies[b].colour); });
    drawBones(painter, data, poses);
    this.drawSolids(inOrder([...this.fixtures, ...solids], painter.eye), cells);
    drawPivots(painter, data, poses);
    painter.drawTriad();
  }

  path(body) {
    const count = this.data.bodies.length;
    return triples(this.motion.position).filter((_, i) => i % count === body);
  }

  solids(poses) {
    return this.data.bodies.flatMap((body, b) => body.solids.map((solid) => ({ ...place(solid, poses[b], body.colour, false), ghost: body.ghost })));
  }

  drawFixtures(cells) {
    for (const solid of inOrder(this.fixtures, this.painter.eye)) {
      this.painter.drawSolid(solid, this.data.planes);
      this.hide(solid, cells);
    }
  }

  drawSolids(ordered, cells) { // what stands still is there already: again where it hides what was drawn since
    const moving = [], painter = this.painter;
    for (const solid of ordered) {
      if (solid.fixed && !moving.some((other) => overlap(other, solid, painter.eye))) continue;
      painter.pen.globalAlpha = solid.ghost ? 0.4 : 1; // what was measured is seen through
      painter.drawSolid(solid, this.data.planes);
      painter.pen.globalAlpha = 1;
      if (!solid.fixed) moving.push(solid);
      if (!solid.fixed) this.hide(solid, cells);
    }
  }

  inDepth() { // cells of terrain from the back to the front, each by its farthest corner
    const depth = (cell) => Math.min(...cell.polygon.map((p) => this.painter.depth(p)));
    return this.cells.map((cell) => ({ cell, depth: depth(cell) })).sort((a, b) => a.depth - b.depth);
  }

  hide(solid, cells) { // draw again the cells that lie over a solid and are nearer than what it stands on
    if (this.elevation < LOW) return;
    const { front, right, up } = this.painter.eye, level = { corners: solid.corners, radius: 0 };
    const depth = dot(solid.centre, front) + support(level, [front[0], front[1], 0]);
    const [wide, tall] = [right, up].map((n) => Math.max(support(solid, n), support(solid, back(n))));
    const over = cells.filter(({ cell, depth: farthest }) => {
      const d = sum(cell.polygon[0], solid.centre, -1);
      return farthest > depth && Math.abs(dot(d, right)) < wide + cell.width && Math.abs(dot(d, up)) < tall + cell.width;
    });
    if (over.length) this.painter.within(solid, () => over.forEach(({ cell }) => this.painter.drawCell(cell)));
  }
}
