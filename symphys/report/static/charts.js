// Draws the curves of a page as SVG, from the numbers that it holds; shows those below the pointer. Comes after numbers.js.

const WIDTH = 1000, NARROW = 400, TOP = 26, BOTTOM = 34, LEFT = 58, GAP = 14, INCH = 97, BAR = 20, LETTER = 7;
const WORK = "work [rollouts]"; // title of the axes that follow the film of a solve
const TIME = "time [s]"; // title of the axes that share a moment

function numbers(packed) { // differences in steps of one size, or numbers as they are
  if (!packed.d) return packed;
  let whole = 0;
  return packed.d.map((d) => { whole += d; return whole * packed.q; });
}

function transform(scale) { // of numbers to heights: linear, logarithmic, or linear near 0 and logarithmic beyond
  if (!scale) return (v) => v;
  if (scale < 0) return (v) => (v > 0 ? Math.log10(v) : NaN);
  return (v) => Math.sign(v) * Math.log10(1 + Math.abs(v) / scale);
}

function evenTicks(low, high, count) { // at round numbers
  const rough = (high - low) / count || 1, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= rough * 0.999);
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) ticks.push(k * step);
  return ticks;
}

function ticksOf(scale, low, high) { // low and high: heights
  if (!scale) return evenTicks(low, high, 4);
  if (scale < 0) {
    if (high - low < 1) return evenTicks(10 ** low, 10 ** high, 4).filter((v) => v > 0);
    const every = Math.ceil((high - low) / 5), ticks = [];
    for (let p = Math.ceil(low - 1e-9); p <= high + 1e-9; p += every) ticks.push(10 ** p);
    return ticks;
  }
  const most = Math.floor(Math.log10(scale * (10 ** Math.max(Math.abs(low), Math.abs(high)) - 1) || 1));
  const least = Math.ceil(Math.log10(scale)), every = Math.max(1, Math.ceil((most - least + 1) / 3)), ticks = [0];
  for (let p = most; p >= least; p -= every) ticks.push(10 ** p, -(10 ** p));
  return ticks.filter((v) => transform(scale)(v) >= low - 1e-9 && transform(scale)(v) <= high + 1e-9);
}

function joined(points) { return `M${points.map((p) => p.map((v) => v.toFixed(1)).join(" ")).join("L")}`; }

function extent(values) {
  return values.reduce(([a, b], v) => (Number.isFinite(v) ? [Math.min(a, v), Math.max(b, v)] : [a, b]), [Infinity, -Infinity]);
}

class Panel {
  constructor(data, left, top, width, height = 1.75) { // height: of the panel with its titles, in inches of a figure
    this.data = data;
    this.height = data.bars ? BAR * data.bars.length : INCH * height - TOP - BOTTOM;
    this.left = left + (data.bars ? 130 : LEFT);
    this.top = top + TOP;
    this.width = width - (this.left - left) - GAP - (data.bars ? 60 : 0);
    this.xs = (data.x || []).map(numbers);
    this.lines = (data.lines || []).map((line) => ({ ...line, l: (line.l || "").split(" "), y: numbers(line.y), x: this.xs[line.x] }));
    this.up = transform(data.scale);
    this.over = transform(data.across);
    this.range();
  }

  range() {
    const { least = [], met, edges = [], bars } = this.data;
    this.wide = bars ? least : extent(this.xs.flat().filter((v) => v !== null).map(this.over));
    if (!Number.isFinite(this.wide[0])) this.wide = [0, 1];
    if (!(this.wide[1] > this.wide[0])) this.wide = [this.wide[0] - 0.5, this.wide[0] + 0.5];
    const heights = this.lines.flatMap((line) => line.y).filter((v) => v !== null).map(this.up);
    let [low, high] = extent([...heights, ...least.map(this.up), ...(met ? [0.5, 2].map(this.up) : [])]);
    if (!(high >= low)) [low, high] = [0, 1];
    const room = Math.max(high - low, 1e-9 * Math.abs(high)), flat = !(high - low > 1e-9 * Math.max(1, Math.abs(high)));
    const near = edges.map(this.up).filter((v) => v >= low - 16 * room && v <= high + 16 * room);
    if (!flat) [low, high] = extent([low, high, ...near]);
    const margin = flat ? 1 : 0.07 * (high - low);
    this.tall = [low - margin, high + margin];
  }

  x(v) { return this.left + ((this.over(v) - this.wide[0]) / (this.wide[1] - this.wide[0])) * this.width; }

  y(v) { return this.top + (1 - (this.up(v) - this.tall[0]) / (this.tall[1] - this.tall[0])) * this.height; }

  runs(line) { // its points on the page, a list for each stretch without a gap
    const runs = [];
    let last = null;
    line.y.forEach((value, k) => {
      const x = this.x(line.x[k]), y = this.y(value);
      if (value === null || line.x[k] === null || !Number.isFinite(x) || !Number.isFinite(y)) { last = null; return; }
      if (!last) runs.push([]);
      const run = runs[runs.length - 1];
      if (last && line.l.includes("steps")) run.push([x, last[1]]);
      if (last && line.l.includes("middles")) run.push([(x + last[0]) / 2, last[1]], [(x + last[0]) / 2, y]);
      run.push([x, y]);
      last = [x, y];
    });
    return runs;
  }

  drawn(line) {
    const has = (word) => line.l.includes(word);
    if (has("points")) {
      const spots = line.y.map((v, k) => [this.x(line.x[k]), v === null ? NaN : this.y(v)]).filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
      const ink = spots.map(([x, y]) => `M${x.toFixed(1)} ${y.toFixed(1)}h0`).join("");
      return `<g fill="none" stroke="${line.c}" stroke-linecap="round" stroke-opacity="0.6"><path d="${ink}" stroke-width="3"/></g>`;
    }
    if (has("dots") || has("rings")) {
      const spot = (v, k) => `<circle cx="${this.x(line.x[k]).toFixed(1)}" cy="${this.y(v).toFixed(1)}" r="4"/>`;
      const linked = (v, k) => (line.links?.[k] ? `<a href="${escaped(line.links[k])}">${spot(v, k)}</a>` : spot(v, k));
      const spots = line.y.map((v, k) => (v === null ? "" : linked(v, k)));
      return `<g fill="${has("dots") ? line.c : "var(--card)"}" stroke="${line.c}">${spots.join("")}</g>`;
    }
    const look = has("dashed") ? 'stroke-dasharray="4 3"' : has("dotted") ? 'stroke-dasharray="1 2"' : has("pale") ? 'stroke-opacity="0.25"' : "";
    const few = line.y.length <= 40 && !["dashed", "dotted", "pale", "plain", "steps"].some(has);
    const mark = few ? line.y.map((v, k) => (v === null ? "" : `M${this.x(line.x[k]).toFixed(1)} ${this.y(v).toFixed(1)}h0`)).join("") : "";
    const dots = few ? `<path d="${mark}" stroke-width="5" stroke-linecap="round"/>` : "";
    const runs = this.runs(line), shade = has("area") ? this.area(line, runs) : "";
    return `<g fill="none" stroke="${line.c}" ${look}>${shade}<path d="${runs.map(joined).join("")}" stroke-width="${line.w}"/>${dots}</g>`;
  }

  area(line, runs) { // from the line down to 0, or to the lower end of the axis
    const base = Math.min(this.top + this.height, this.data.scale < 0 ? Infinity : this.y(0));
    const shapes = runs.map((run) => `${joined([[run[0][0], base], ...run, [run[run.length - 1][0], base]])}Z`);
    return `<path d="${shapes.join("")}" fill="${line.c}" fill-opacity="0.14" stroke="none"/>`;
  }

  axes() {
    const { left, top, width, height, data } = this, bottom = top + height;
    const level = (v, c) => `<path d="M${left} ${this.y(v).toFixed(1)}h${width}" class="${c}"/>`;
    const room = width + GAP, squeezed = data.title.length * LETTER > room ? ` textLength="${room}" lengthAdjust="spacingAndGlyphs"` : "";
    const out = [`<text x="${left}" y="${top - 9}" class="title"${squeezed}>${escaped(data.title)}</text>`];
    const along = data.across ? ticksOf(data.across, ...this.wide) : evenTicks(...this.wide, Math.max(2, Math.round(width / 60)));
    for (const v of along) {
      out.push(`<path d="M${this.x(v).toFixed(1)} ${top}v${height}" class="grid"/>`);
      out.push(`<text x="${this.x(v).toFixed(1)}" y="${bottom + 14}" text-anchor="middle">${written(v)}</text>`);
    }
    if (data.along) out.push(`<text x="${left + width}" y="${bottom + 27}" text-anchor="end">${escaped(data.along)}</text>`);
    if (data.bars) return out.join("");
    const clipped = (v, open) => (v === null ? open : Math.min(Math.max(this.y(v), top), bottom));
    for (const [low, high] of data.beyond || []) {
      const upper = clipped(high, top), lower = clipped(low, bottom);
      out.push(`<rect x="${left}" y="${upper.toFixed(1)}" width="${width}" height="${(lower - upper).toFixed(1)}" class="beyond"/>`);
    }
    (data.stages || []).forEach(([from, to, text], k) => {
      const [a, b] = [this.x(from), this.x(to)];
      if (k % 2) out.push(`<rect x="${a.toFixed(1)}" y="${top}" width="${(b - a).toFixed(1)}" height="${height}" class="ground"/>`);
      if (b - a > 6 * text.length) out.push(`<text x="${((a + b) / 2).toFixed(1)}" y="${top + 10}" text-anchor="middle">${escaped(text)}</text>`);
    });
    for (const v of ticksOf(data.scale, ...this.tall)) {
      out.push(level(v, "grid"), `<text x="${left - 6}" y="${(this.y(v) + 3.5).toFixed(1)}" text-anchor="end">${written(v)}</text>`);
    }
    out.push(...(data.ticks || []).map((v) => `<path d="M${this.x(v).toFixed(1)} ${bottom}v-6" class="tick"/>`));
    const inside = (v) => this.up(v) >= this.tall[0] && this.up(v) <= this.tall[1];
    out.push(...(data.edges || []).filter(inside).map((v) => level(v, "edge")));
    if (data.met) out.push(`<rect x="${left}" y="${this.y(1).toFixed(1)}" width="${width}" height="${(bottom - this.y(1)).toFixed(1)}" class="met"/>`, level(1, "limit"));
    return out.join("");
  }

  bars() {
    return this.data.bars.map(([name, colour, spans, note], row) => {
      const y = this.top + BAR * row + 4, h = BAR - 8;
      const all = spans.map(([a, b]) => `<rect x="${this.x(a).toFixed(1)}" y="${y}" width="${(this.x(b) - this.x(a)).toFixed(1)}" height="${h}" fill="${colour}"/>`);
      const texts = `<text x="${this.left - 8}" y="${y + 10}" text-anchor="end">${escaped(name)}</text><text x="${this.left + this.width + 8}" y="${y + 10}">${note}</text>`;
      return `${texts}<rect x="${this.left}" y="${y}" width="${this.width}" height="${h}" class="ground"/>${all.join("")}`;
    }).join("");
  }

  end() { // a vertical line with a text beside it
    const { left, top, width, height, data } = this, x = this.x(data.end[0]), late = x > left + width / 2;
    const text = `<text x="${(x + (late ? -5 : 5)).toFixed(1)}" y="${top + 10}" text-anchor="${late ? "end" : "start"}">${escaped(data.end[1])}</text>`;
    return `<path d="M${x.toFixed(1)} ${top}v${height}" class="end"/>${text}`;
  }

  svg() {
    const curves = this.data.bars ? this.bars() : this.lines.map((line) => this.drawn(line)).join("");
    return `<g>${this.axes()}${curves}${this.data.end ? this.end() : ""}</g>`;
  }

  value(x) { // what the axis has at a place of the page
    const place = this.wide[0] + ((x - this.left) / this.width) * (this.wide[1] - this.wide[0]);
    return this.data.across ? 10 ** place : place;
  }

  at(x) { // the numbers below the pointer, in words; null beside the panel
    if (x < this.left || x > this.left + this.width || !this.lines.length) return null;
    const value = this.value(x);
    const parts = this.lines.filter((line) => line.n && !line.l.includes("dots") && !line.l.includes("rings")).map((line) => {
      const before = line.x.findLastIndex((v) => v !== null && v <= value);
      const nearest = () => line.x.reduce((best, v, k) => (Math.abs(v - value) < Math.abs(line.x[best] - value) ? k : best), 0);
      const near = line.l.includes("steps") ? before : nearest();
      return line.y[near] === null || line.y[near] === undefined ? "" : `${line.n} ${written(line.y[near])}`;
    });
    return `${this.data.along} ${written(Number(value.toPrecision(4)))}: ${[...new Set(parts)].filter(Boolean).join(", ")}`;
  }
}

function layOut(chart, whole) { // the panels in their places, below each other where there is little room, and the height of all
  const columns = whole < WIDTH ? 1 : chart.columns, width = whole / columns, panels = [];
  const all = columns < chart.columns ? chart.panels.filter(Boolean) : chart.panels;
  let top = 0;
  for (let row = 0; row < all.length; row += columns) {
    const made = all.slice(row, row + columns).map((data, k) => data && new Panel(data, k * width, top, width, chart.height));
    panels.push(...made.filter(Boolean));
    top += Math.max(...made.filter(Boolean).map((panel) => panel.height), 0) + TOP + BOTTOM;
  }
  return { panels, height: top };
}

function drawChart(chart, width = WIDTH) {
  const { panels, height } = layOut(chart, width);
  const keys = chart.keys.map(([name, colour, look]) => `<span><i class="${look}" style="color:${colour}"></i>${escaped(name)}</span>`);
  const svg = `<svg viewBox="0 0 ${width} ${height}" role="img">${panels.map((panel) => panel.svg()).join("")}</svg>`;
  return { html: `<div class="legend">${keys.join("")}<output></output></div>${svg}`, panels };
}

class Figure { // draws a chart in its place, shows the numbers below the pointer, and one moment in all charts over time
  constructor(root) {
    const place = root.querySelector("div"), width = place.clientWidth < 520 ? NARROW : WIDTH;
    const { html, panels } = drawChart(JSON.parse(root.querySelector("script").textContent), width);
    place.innerHTML = html;
    [this.svg, this.output, this.panels, this.width] = [place.querySelector("svg"), place.querySelector("output"), panels, width];
    this.worked = panels.filter((panel) => panel.data.along === WORK);
    this.timed = panels.filter((panel) => panel.data.along === TIME);
    this.cursor = this.svg.appendChild(document.createElementNS(this.svg.namespaceURI, "path"));
    this.cursor.setAttribute("class", "cursor");
    this.svg.addEventListener("pointermove", (event) => this.point(event));
    this.svg.addEventListener("pointerleave", () => moment(null, this));
    this.band = this.svg.insertBefore(document.createElementNS(this.svg.namespaceURI, "path"), this.svg.firstChild);
    this.band.setAttribute("class", "band");
    this.svg.addEventListener("pointerdown", (event) => { this.from = this.timeAt(event); });
    this.svg.addEventListener("pointerup", (event) => this.brush(this.timeAt(event)));
    document.addEventListener("stretch", ({ detail }) => this.mark(detail));
    document.addEventListener("moment", (event) => this.show(event.detail));
    if (this.worked.length) document.addEventListener("worked", ({ detail }) => {
      const at = (panel) => Math.max(panel.x(detail), panel.left) || panel.left; // the guess took nothing
      this.lines(detail === null ? [] : this.worked, at);
    });
  }

  below(event) { // the panel below the pointer, and the place of the pointer in the picture
    const box = this.svg.getBoundingClientRect(), scale = this.width / box.width;
    const [x, y] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    const panel = this.panels.find((p) => y >= p.top - TOP && y <= p.top + p.height + BOTTOM && x >= p.left && x <= p.left + p.width);
    return [panel, x];
  }

  timeAt(event) {
    const [panel, x] = this.below(event);
    return panel && panel.data.along === TIME ? panel.value(x) : null;
  }

  brush(to) { // a stretch of time that was drawn out; a mere click ends it
    if (this.from === null || this.from === undefined || to === null) return;
    const ends = [Math.min(this.from, to), Math.max(this.from, to)], [panel] = this.timed;
    const detail = panel.x(ends[1]) - panel.x(ends[0]) > 6 ? ends : null;
    document.dispatchEvent(new CustomEvent("stretch", { detail }));
  }

  mark(ends) {
    const parts = ends ? this.timed.map((p) => {
      const [a, b] = ends.map((t) => Math.min(Math.max(p.x(t), p.left), p.left + p.width).toFixed(1));
      return `M${a} ${p.top}H${b}v${p.height}H${a}Z`;
    }) : [];
    this.band.setAttribute("d", parts.join(""));
  }

  point(event) {
    const [panel, x] = this.below(event);
    if (!panel) return moment(null, this);
    if (panel.data.along === TIME) moment(panel.value(x), this);
    else this.lines([panel], () => x);
    this.output.textContent = panel.at(x) || "";
  }

  show({ time, from }) {
    if (!this.timed.length) return;
    if (time === null) return this.lines([], null);
    this.lines(this.timed, (panel) => panel.x(time));
    if (from !== this) this.output.textContent = (this.timed.length && this.timed[0].at(this.timed[0].x(time))) || "";
  }

  lines(panels, x) { // a vertical line in each of the panels
    const inside = panels.filter((p) => x(p) >= p.left - 0.5 && x(p) <= p.left + p.width + 0.5);
    this.cursor.setAttribute("d", inside.map((p) => `M${x(p).toFixed(1)} ${p.top}v${p.height}`).join(""));
    if (!panels.length) this.output.textContent = "";
  }
}

document.querySelectorAll("figure.chart").forEach((root) => new Figure(root));
