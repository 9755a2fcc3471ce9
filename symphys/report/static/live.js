// The page of a batch while it is solved. Comes after charts.js.

const PALETTE = "COLOURS";
const TITLES = { objective: "Objective", worst: "Largest error / tolerance" };

function scaleOf(values) { // logarithmic where numbers span decades
  const known = values.filter((v) => Number.isFinite(v)), least = Math.min(...known), most = Math.max(...known);
  return known.length && least > 0 && most > 30 * least ? -1 : 0;
}

function convergence(runs) { // a chart as charts.js draws it
  const panels = Object.entries(TITLES).map(([key, title]) => {
    const lines = runs.map((run, k) => ({ x: k, y: run[key], n: run.name, c: PALETTE[k % PALETTE.length], w: 1.6, l: "plain" }));
    const some = lines.filter((line) => line.y.some((v) => Number.isFinite(v)));
    const values = some.flatMap((line) => line.y);
    return some.length && { title, lines: some, x: runs.map((run) => run.seconds), along: "time of the solve [s]", scale: scaleOf(values), across: 0, met: key === "worst" && scaleOf(values) < 0 };
  });
  const keys = runs.map((run, k) => [run.name, PALETTE[k % PALETTE.length], ""]);
  return { columns: 2, height: 2.6, keys, panels: panels.filter(Boolean) };
}

function show(state) {
  const open = state.runs.filter((run) => run.seconds.length);
  document.getElementById("title").textContent = state.runs.length === 1 ? state.runs[0].name : `${state.runs.length} runs`;
  document.getElementById("note").textContent = state.note;
  document.getElementById("runs").replaceChildren(...state.runs.map((run) => {
    const item = document.createElement("li"), last = run.objective[run.objective.length - 1];
    item.textContent = `${run.name}: ${run.words}${Number.isFinite(last) ? `, objective ${written(last)}` : ""}`;
    return item;
  }));
  const root = document.getElementById("curves");
  if (!open.length) return;
  const data = document.createElement("script");
  data.type = "application/json";
  data.textContent = JSON.stringify(convergence(open));
  root.className = "chart";
  root.replaceChildren(document.createElement("div"), data);
  new Figure(root);
}

async function ask() {
  try {
    const state = await (await fetch("/state")).json();
    if (state.done) { window.location.href = state.done; return; }
    show(state);
  } catch {
    document.getElementById("note").textContent = "The command has ended.";
    return;
  }
  setTimeout(ask, 1000);
}

ask();
