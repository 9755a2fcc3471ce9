// Draws the curves of a light page as SVG, from the numbers that it holds; shows those below the pointer. Comes after numbers.js.

const WIDTH = 1000, TOP = 26, BOTTOM = 34, LEFT = 58, GAP = 14, HEIGHT = 170, BAR = 20;

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

function extent(values) {
  return values.reduce(([a, b], v) => (Number.isFinite(v) ? [Math.min(a, v), Math.max(b, v)] : [a, b]), [Infinity, -Infinity]);
}

class Panel {
  constructor(data, left, top, width) {
    this.data = data;
    this.height = data.bars ? BAR * data.bars.length : HEIGHT - TOP - BOTTOM;
    this.left = left + (data.bars ? 130 : LEFT);
    this.top = top + TOP;
    this.width = width - (this.left - left) - GAP - (data.bars ? 60 : 0);
    this.xs = (data.x || []).map(numbers);
    this.lines = (data.lines || []).map((line) => ({ ...line, l: (line.l || "").split(" "), y: numbers(line.y), x: this.xs[line.x] }));
    this.up = transform(data.scale);
    this.range();
  }

  range() {
    const { least = [], met, edges = [], bars } = this.data;
    this.wide = bars ? least : extent(this.xs.flat());
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

  x(v) { return this.left + ((v - this.wide[0]) / (this.wide[1] - this.wide[0])) * this.width; }

  y(v) { return this.top + (1 - (this.up(v) - this.tall[0]) / (this.tall[1] - this.tall[0])) * this.height; }

  path(line) {
    let text = "", pen = "M";
    line.y.forEach((value, k) => {
      const x = this.x(line.x[k]), y = this.y(value);
      if (value === null || line.x[k] === null || !Number.isFinite(x) || !Number.isFinite(y)) { pen = "M"; return; }
      if (line.l.includes("steps") && pen === "L") text += `H${x.toFixed(1)}V${y.toFixed(1)}`;
      else if (line.l.includes("middles") && pen === "L") text += `H${((x + this.x(line.x[k - 1])) / 2).toFixed(1)}V${y.toFixed(1)}H${x.toFixed(1)}`;
      else text += `${pen}${x.toFixed(1)} ${y.toFixed(1)}`;
      pen = "L";
    });
    return text;
  }

  drawn(line) {
    const has = (word) => line.l.includes(word);
    if (has("dots") || has("rings")) {
      const spots = line.y.map((v, k) => `<circle cx="${this.x(line.x[k]).toFixed(1)}" cy="${this.y(v).toFixed(1)}" r="4"/>`);
      return `<g fill="${has("dots") ? line.c : "#fff"}" stroke="${line.c}">${spots.join("")}</g>`;
    }
    const look = has("dashed") ? 'stroke-dasharray="4 3"' : has("dotted") ? 'stroke-dasharray="1 2"' : has("pale") ? 'stroke-opacity="0.25"' : "";
    const few = line.y.length <= 40 && !["dashed", "dotted", "pale", "plain"].some(has);
    const mark = few ? line.y.map((v, k) => (v === null ? "" : `M${this.x(line.x[k]).toFixed(1)} ${this.y(v).toFixed(1)}h0`)).join("") : "";
    const dots = few ? `<path d="${mark}" stroke-width="5" stroke-linecap="round"/>` : "";
    return `<g fill="none" stroke="${line.c}" ${look}><path d="${this.path(line)}" stroke-width="${line.w}"/>${dots}</g>`;
  }

  axes() {
    const { left, top, width, height, data } = this, bottom = top + height;
    const level = (v, c) => `<path d="M${left} ${this.y(v).toFixed(1)}h${width}" class="${c}"/>`;
    const out = [`<text x="${left}" y="${top - 9}" class="title">${escaped(data.title)}</text>`];
    for (const v of evenTicks(...this.wide, Math.max(2, Math.round(width / 60)))) {
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
    out.push(...(data.edges || []).map((v) => level(v, "edge")));
    if (data.end) {
      const x = this.x(data.end[0]), late = x > left + width / 2;
      out.push(`<path d="M${x.toFixed(1)} ${top}v${height}" class="end"/>`);
      out.push(`<text x="${(x + (late ? -5 : 5)).toFixed(1)}" y="${top + 10}" text-anchor="${late ? "end" : "start"}">${escaped(data.end[1])}</text>`);
    }
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

  svg() { return `<g>${this.axes()}${this.data.bars ? this.bars() : this.lines.map((line) => this.drawn(line)).join("")}</g>`; }

  at(x) { // the numbers below the pointer, in words; null beside the panel
    const value = this.wide[0] + ((x - this.left) / this.width) * (this.wide[1] - this.wide[0]);
    if (value < this.wide[0] || value > this.wide[1] || !this.lines.length) return null;
    const parts = this.lines.filter((line) => line.n && !line.l.includes("dots") && !line.l.includes("rings")).map((line) => {
      const near = line.x.reduce((best, v, k) => (Math.abs(v - value) < Math.abs(line.x[best] - value) ? k : best), 0);
      return line.y[near] === null || line.y[near] === undefined ? "" : `${line.n} ${written(line.y[near])}`;
    });
    return `${this.data.along} ${written(Number(value.toPrecision(4)))}: ${[...new Set(parts)].filter(Boolean).join(", ")}`;
  }
}

function layOut(chart) { // the panels in their places, and the height of all
  const width = WIDTH / chart.columns, panels = [];
  let top = 0;
  for (let row = 0; row < chart.panels.length; row += chart.columns) {
    const made = chart.panels.slice(row, row + chart.columns).map((data, k) => data && new Panel(data, k * width, top, width));
    panels.push(...made.filter(Boolean));
    top += Math.max(...made.filter(Boolean).map((panel) => panel.height), 0) + TOP + BOTTOM;
  }
  return { panels, height: top };
}

function drawChart(chart) {
  const { panels, height } = layOut(chart);
  const keys = chart.keys.map(([name, colour]) => `<span><i style="background:${colour}"></i>${escaped(name)}</span>`);
  const svg = `<svg viewBox="0 0 ${WIDTH} ${height}" role="img">${panels.map((panel) => panel.svg()).join("")}</svg>`;
  return { html: `<div class="legend">${keys.join("")}<output></output></div>${svg}`, panels };
}

document.querySelectorAll("figure.chart").forEach((root) => {
  const { html, panels } = drawChart(JSON.parse(root.querySelector("script").textContent));
  const place = root.querySelector("div");
  place.innerHTML = html;
  const svg = place.querySelector("svg"), output = place.querySelector("output");
  svg.addEventListener("pointermove", (event) => {
    const box = svg.getBoundingClientRect(), scale = WIDTH / box.width;
    const [x, y] = [(event.clientX - box.left) * scale, (event.clientY - box.top) * scale];
    const panel = panels.find((p) => y >= p.top - TOP && y <= p.top + p.height + BOTTOM && x >= p.left && x <= p.left + p.width);
    output.textContent = (panel && panel.at(x)) || "";
  });
  svg.addEventListener("pointerleave", () => { output.textContent = ""; });
});
