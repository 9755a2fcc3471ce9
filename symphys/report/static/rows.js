// Shows a long table a page at a time, sorted by a click on a heading and filtered by words and comparisons.

const OPERATORS = {
  "<": (a, b) => a < b, ">": (a, b) => a > b, "<=": (a, b) => a <= b, ">=": (a, b) => a >= b, "=": (a, b) => a === b,
};
const INFINITE = { inf: Infinity, "-inf": -Infinity };

class Rows {
  constructor(data) {
    this.data = data;
    this.count = data.columns.length ? data.columns[0].of.length : 0;
    this.order = Array.from({ length: this.count }, (_, row) => row);
    this.shown = this.order;
    this.sorted = null; // [column, 1 or -1]
    this.first = 0;
    this.texts = [];
    this.visible = data.columns.filter((column) => !column.hidden);
    this.pair = []; // rows that are compared
  }

  value(column, row) { // what is compared: a number or a word; null where nothing is known
    const found = column.of[row];
    if (column.kind === "word") return column.words[found];
    return typeof found === "string" && column.kind === "number" ? INFINITE[found] : found;
  }

  text(row) { // all words and numbers of a row, in small letters
    const of = (column) => { const v = this.value(column, row); return v === null ? "" : String(v); };
    this.texts[row] ??= this.visible.map(of).join(" ").toLowerCase();
    return this.texts[row];
  }

  sort(column) {
    const again = this.sorted && this.sorted[0] === column;
    const sign = again ? -this.sorted[1] : 1;
    this.sorted = [column, sign];
    const compare = (a, b) => (a < b ? -sign : a > b ? sign : 0);
    const keys = this.order.map((row) => this.value(column, row));
    const known = (key) => key !== null && key !== "";
    this.order = this.order.map((row, k) => [keys[k], row]).sort(([a, i], [b, j]) => (
      known(a) && known(b) ? compare(a, b) || i - j : known(b) - known(a) || i - j)).map(([, row]) => row);
  }

  test(word) { // whether a row passes one word of the filter
    const [, name, operator, number] = word.match(/^([^<>=]+)(<=|>=|<|>|=)(-?(?:inf|[\d.]+(?:e[+-]?\d+)?))$/) || [];
    const column = name && this.data.columns.find((c) => c.kind === "number" && c.title.toLowerCase().replace(/ /g, "_").startsWith(name));
    if (!column) return (row) => this.text(row).includes(word);
    const limit = INFINITE[number] ?? Number(number);
    return (row) => { const v = this.value(column, row); return v !== null && OPERATORS[operator](v, limit); };
  }

  filter(text) {
    const tests = text.toLowerCase().split(/\s+/).filter(Boolean).map((word) => this.test(word));
    this.shown = tests.length ? this.order.filter((row) => tests.every((passes) => passes(row))) : this.order;
    this.first = 0;
  }

  turn(pages) { // forward or back, within what there is
    const last = Math.max(0, Math.floor((this.shown.length - 1) / this.data.page) * this.data.page);
    this.first = Math.min(last, Math.max(0, this.first + pages * this.data.page));
  }

  cell(column, row) {
    const found = column.of[row];
    if (column.kind === "link") return found ? `<td><a href="${escaped(found)}">${escaped(column.text)}</a></td>` : "<td></td>";
    if (column.kind === "number") {
      const value = this.value(column, row);
      return `<td class="number">${value === null ? "–" : Number.isFinite(value) ? written(value) : value > 0 ? "∞" : "−∞"}</td>`;
    }
    const word = escaped(column.words[found]);
    return `<td>${column.levels ? `<span class="pill ${column.levels[found]}">${word}</span>` : word}</td>`;
  }

  head() {
    const pick = this.data.names ? '<th scope="col">compare</th>' : "";
    return pick + this.visible.map((column) => {
      const k = this.data.columns.indexOf(column);
      const sign = this.sorted && this.sorted[0] === column ? (this.sorted[1] > 0 ? " ▲" : " ▼") : "";
      const order = sign ? ` aria-sort="${this.sorted[1] > 0 ? "ascending" : "descending"}"` : "";
      const kind = column.kind === "number" ? ' class="number"' : "";
      return `<th scope="col"${kind}${order}><button type="button" data-column="${k}">${escaped(column.title)}${sign}</button></th>`;
    }).join("");
  }

  body() {
    const rows = this.shown.slice(this.first, this.first + this.data.page);
    return rows.map((row) => `<tr>${this.box(row)}${this.visible.map((column) => this.cell(column, row)).join("")}</tr>`).join("");
  }

  box(row) { // that picks a row for comparison
    if (!this.data.names) return "";
    const checked = this.pair.includes(row) ? " checked" : "";
    return `<td><input type="checkbox" data-row="${row}"${checked} aria-label="Compare ${escaped(this.data.names[row])}"></td>`;
  }

  pick(row) { // of three the last two are compared
    this.pair = this.pair.includes(row) ? this.pair.filter((other) => other !== row) : [...this.pair, row].slice(-2);
  }

  compared() { // what two rows have, side by side, and how far it is apart
    if (!this.pair.length) return "";
    if (this.pair.length < 2) return '<p class="note">Tick a second one to compare them.</p>';
    const lines = this.data.columns.filter((column) => column.kind !== "link").map((column) => {
      const [a, b] = this.pair.map((row) => this.value(column, row));
      if ([a, b].some((v) => v === null || v === "")) return "";
      const apart = column.kind === "number" ? (a === b ? "the same" : written(Number((b - a).toPrecision(4)))) : a === b ? "the same" : "another";
      const cells = this.pair.map((row) => this.cell(column, row)).join("");
      return `<tr><th scope="row">${escaped(column.title)}</th>${cells}<td class="number">${apart}</td></tr>`;
    });
    const heads = this.pair.map((row) => `<th scope="col">${escaped(this.data.names[row])}</th>`).join("");
    return `<h3>Two ${this.data.noun}s</h3><div class="scroll"><table aria-label="Comparison"><thead><tr><th></th>${heads}
      <th scope="col" class="number">difference</th></tr></thead><tbody>${lines.join("")}</tbody></table></div>`;
  }

  place() { // where in the table the page is
    if (!this.shown.length) return `no ${this.data.noun} of ${this.count} passes the filter`;
    const last = Math.min(this.first + this.data.page, this.shown.length);
    const of = this.shown.length < this.count ? `${this.shown.length} of ${this.count}` : `${this.count}`;
    return `${this.first + 1} to ${last} of ${of} ${this.data.noun}s`;
  }
}

function frame(root, rows) { // the parts of the table, and what moves them
  root.innerHTML = `<div class="controls"><input type="search" placeholder="Filter" aria-label="Filter of the rows">
    <output></output><span class="views"><button type="button" data-turn="-1">‹</button><button type="button" data-turn="1">›</button></span></div>
    <div class="scroll"><table><thead><tr></tr></thead><tbody></tbody></table></div><div class="pair"></div>`;
  const [input, output, head, body, pair] = ["input", "output", "thead tr", "tbody", ".pair"].map((name) => root.querySelector(name));
  const show = () => {
    [output.textContent, head.innerHTML, body.innerHTML] = [rows.place(), rows.head(), rows.body()];
    pair.innerHTML = rows.compared();
  };
  body.addEventListener("change", (event) => {
    const row = Number(event.target.dataset.row);
    rows.pick(row);
    show();
    body.querySelector(`[data-row="${row}"]`)?.focus();
  });
  input.addEventListener("input", () => { rows.filter(input.value); show(); });
  head.addEventListener("click", (event) => {
    const button = event.target.closest("[data-column]");
    if (!button) return;
    rows.sort(rows.data.columns[Number(button.dataset.column)]);
    rows.filter(input.value);
    show();
  });
  root.querySelectorAll("[data-turn]").forEach((b) => b.addEventListener("click", () => { rows.turn(Number(b.dataset.turn)); show(); }));
  show();
}

document.querySelectorAll("div.rows").forEach((root) => frame(root, new Rows(JSON.parse(root.querySelector("script").textContent))));
