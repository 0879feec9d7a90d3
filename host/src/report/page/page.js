"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const config = { responsive: true, displayModeBar: false };

// Colours follow the page, also when that changes between day and night.
function flat(title) {
  const axis = { gridcolor: style("--line"), zerolinecolor: style("--line") };
  return {
    margin: { l: 50, r: 10, t: 10, b: 40 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: style("--ink") }, xaxis: { ...axis, title: { text: title } }, yaxis: { ...axis, type: "log" },
    legend: { orientation: "h", x: 0, y: 1.1 }, barmode: "overlay",
  };
}

const surface = (s, name, more) => ({
  type: "mesh3d", name, x: s.x, y: s.y, z: s.z, i: s.i, j: s.j, k: s.k, hoverinfo: "x+y+z", flatshading: false,
  lighting: { ambient: 0.5, diffuse: 0.6, specular: 0.15, roughness: 0.8 }, lightposition: { x: 1e4, y: 1e5, z: 1e5 },
  ...more,
});
const lines = (l, name, colour, width) => ({
  type: "scatter3d", name, x: l.x, y: l.y, z: l.z, mode: l.points ? "markers" : "lines", hoverinfo: "x+y+z",
  line: { color: colour, width }, marker: { color: colour, size: 2 },
});

const space = data.space;
const traces = [["model", surface(space.model, "model", { color: "#b9c4d0" }), true]];
if (space.model.error) {
  const bar = { title: { text: "mm" }, thickness: 12, len: 0.7 };
  const intensity = { intensity: space.model.error, colorscale: "Viridis", colorbar: bar, cmin: 0 };
  traces.push(["error", surface(space.model, "error", intensity), false]);
}
if (space.truth) traces.push(["truth", surface(space.truth, "truth", { color: "#e69f00", opacity: 0.4 }), false]);
traces.push(["skeleton", lines(space.skeleton, "skeleton", "#d55e00", 5), false]);
traces.push(["boundary", lines(space.boundary, "boundary", "#0072b2", 4), true]);

function scene() {
  const axis = (text) => ({ title: { text }, gridcolor: style("--line"), color: style("--faint"), showbackground: false });
  return {
    // The left camera looks along z, and y runs down.
    scene: {
      aspectmode: "data", xaxis: axis("x, mm"), yaxis: axis("y, mm"), zaxis: axis("z, mm"),
      camera: { up: { x: 0, y: -1, z: 0 }, eye: { x: -0.7, y: -0.6, z: -1.5 } },
    },
    margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)",
    font: { color: style("--ink") }, uirevision: "kept",
  };
}

function drawSpace() {
  const shown = traces.map(([name, trace]) => ({ ...trace, visible: byId("trace-" + name).checked }));
  Plotly.react("space", shown, scene(), config);
}

for (const [name, , on] of traces) {
  const label = document.createElement("label");
  const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: on, id: "trace-" + name });
  box.addEventListener("change", drawSpace);
  label.append(box, name);
  byId("traces").append(label);
}

function showLayer(box) {
  for (const layer of document.getElementsByClassName("layer " + box.dataset.layer)) {
    layer.style.display = box.checked ? "" : "none";
  }
}

const layers = document.querySelectorAll("[data-layer]");
for (const box of layers) box.addEventListener("change", () => showLayer(box));

// An address can say what is shown: report.html#show=model,skeleton,hull
function obeyAddress() {
  const show = new URLSearchParams(location.hash.slice(1)).get("show");
  if (show === null) return;
  const names = show.split(",");
  for (const [name] of traces) byId("trace-" + name).checked = names.includes(name);
  for (const box of layers) {
    box.checked = names.includes(box.dataset.layer);
    showLayer(box);
  }
}
addEventListener("hashchange", () => { obeyAddress(); drawSpace(); });

function drawHistogram() {
  const layout = flat("grey value");
  const colours = ["#56b4e9", "#e69f00"];
  const names = ["left", "right"];
  layout.shapes = data.histograms.map(([, level], k) => (
    { type: "line", x0: level + 0.5, x1: level + 0.5, yref: "paper", y0: 0, y1: 1, line: { color: colours[k], dash: "dot" } }
  ));
  const traces = data.histograms.map(([counts], k) => (
    { type: "scatter", mode: "lines", line: { shape: "hvh", color: colours[k] }, name: names[k], y: counts }
  ));
  Plotly.react("histogram", traces, layout, config);
}

function drawShifts() {
  const [values, chosen] = data.shifts;
  const color = values.map((_, k) => (k === chosen ? "#d55e00" : "#56b4e9"));
  Plotly.react("shifts", [{ type: "bar", y: values, marker: { color } }], flat("shift, vertices; e_omega, logarithmic"), config);
}

const cell = (text, number) => {
  const td = document.createElement("td");
  td.textContent = text;
  if (number) td.className = "number";
  return td;
};
const row = (...cells) => {
  const tr = document.createElement("tr");
  tr.append(...cells);
  return tr;
};
const said = (value) => (typeof value === "number" && !Number.isInteger(value) ? value.toPrecision(6) : String(value));

function tellTimes() {
  const longest = Math.max(...Object.values(data.report.times_ms).flatMap((part) => Object.values(part)));
  for (const [part, times] of Object.entries(data.report.times_ms)) {
    for (const [stage, ms] of Object.entries(times)) {
      const bar = document.createElement("meter");
      Object.assign(bar, { max: longest, value: ms });
      const drawn = document.createElement("td");
      drawn.append(bar);
      byId("times").append(row(cell(part), cell(stage), cell(ms.toFixed(2) + " ms", true), drawn));
    }
  }
}

// Every figure of report.json, folded by what it belongs to.
function tell(value, into) {
  const table = document.createElement("table");
  for (const [name, inner] of Object.entries(value)) {
    if (inner !== null && typeof inner === "object" && Object.values(inner).some((x) => x !== null && typeof x === "object")) {
      const details = document.createElement("details");
      const summary = document.createElement("summary");
      summary.textContent = name;
      details.append(summary);
      details.addEventListener("toggle", () => { if (details.childElementCount === 1) tell(inner, details); });
      into.append(details);
    } else if (inner !== null && typeof inner === "object") {
      const plain = Object.entries(inner).map(([k, x]) => (Array.isArray(inner) ? said(x) : k + " " + said(x)));
      table.append(row(cell(name), cell(plain.join(", "))));
    } else {
      table.append(row(cell(name), cell(said(inner))));
    }
  }
  if (table.childElementCount) into.prepend(table);
  if (into.tagName === "DETAILS") into.prepend(into.querySelector("summary"));
}

function summarise() {
  const model = data.report.model;
  if (!model.lowest_mm) return;
  const size = model.highest_mm.map((high, axis) => (high - model.lowest_mm[axis]).toFixed(1));
  byId("summary").textContent = `${size[0]} mm wide, ${size[1]} high, ${size[2]} deep; ` +
    `${(model.volume_mm3 / 1000).toFixed(1)} cm³; ${model.vertices} vertices, ${model.faces} faces`;
}

function drawAll() {
  drawSpace();
  byId("histogram-part").hidden = !data.histograms.length;
  byId("shifts-part").hidden = !data.shifts;
  if (data.histograms.length) drawHistogram();
  if (data.shifts) drawShifts();
}

obeyAddress();
summarise();
tellTimes();
tell(data.report, byId("numbers"));
drawAll();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
