"use strict";
// Draws what the program says of a run, all of it by `show(content)`, which may be called again with another content:
// the switches and the place from which the model is looked at stay as they are. The page itself is the only state.

const byId = (id) => document.getElementById(id);
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const config = { displayModeBar: false };

function element(name, properties, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

// Switches, each with a name, a title and whether it is on at first. One that is there already stays as it was set.
function switches(into, list, changed) {
  const boxes = [...into.querySelectorAll("input")];
  if (boxes.map((box) => box.name).join() !== list.map((item) => item.name).join()) {
    const was = Object.fromEntries(boxes.map((box) => [box.name, box.checked]));
    const made = list.map(({ name, title, shown }) => {
      const box = element("input", { type: "checkbox", name, checked: was[name] ?? shown });
      return element("label", {}, box, title);
    });
    into.replaceChildren(into.querySelector("legend"), ...made);
  }
  into.onchange = changed;
}
const shown = (into) => new Set([...into.querySelectorAll("input:checked")].map((box) => box.name));

// An address can say what is shown: report.html#show=model,skeleton,hull
function obeyAddress() {
  const show = new URLSearchParams(location.hash.slice(1)).get("show");
  if (show === null) return;
  const names = show.split(",");
  for (const box of document.querySelectorAll(".switches input")) box.checked = names.includes(box.name);
}

function tellHead({ title, gates, reached, report }) {
  document.title = title;
  byId("title").textContent = title;
  const item = ({ name, severity, sentence }) =>
    element("li", { className: severity }, element("b", {}, severity + ": " + name), " " + sentence);
  byId("gates").replaceChildren(...gates.map(item));
  byId("reached").textContent = reached ?? (gates.length ? "" : "No gate has anything to say.");
  const model = report?.model;
  const size = model?.highest_mm?.map((high, axis) => (high - model.lowest_mm[axis]).toFixed(1));
  byId("summary").textContent = reached ? "There is no model: the pair was refused." : !size ? "" :
    `${size[0]} mm wide, ${size[1]} high, ${size[2]} deep; ${model.depth_mm.toFixed(0)} mm away; ` +
    `${(model.volume_mm3 / 1000).toFixed(1)} cm³; ${model.vertices} vertices, ${model.faces} faces`;
}

// A light 100 units behind the eye, 40 to its left and 60 above, in coordinates of the projection as the library wants
// it: behind the eye, x and y change their sign there, and z is just above 1.
const lighting = {
  lighting: { ambient: 0.45, diffuse: 0.7, specular: 0.05, roughness: 0.6, fresnel: 0.05 },
  lightposition: { x: 0.97, y: -1.45, z: 1.00022 },
};
const surface = (s, more) => (
  { type: "mesh3d", x: s.x, y: s.y, z: s.z, i: s.i, j: s.j, k: s.k, hoverinfo: "x+y+z", ...lighting, ...more }
);
const lines = (l, color, width) => ({
  type: "scatter3d", x: l.x, y: l.y, z: l.z, mode: l.points ? "markers" : "lines", hoverinfo: "x+y+z",
  line: { color, width }, marker: { color, size: 2 },
});

// What can be seen in space: whether it is at first, and how it is drawn.
function traces({ model, truth, skeleton, boundary }) {
  const all = [{ name: "model", shown: true, trace: surface(model, { color: style("--model") }) }];
  const coloured = (name, text, intensity, cmax) => {
    const colorbar = { title: { text }, thickness: 12, len: 0.8, x: 1, xanchor: "right" };
    all.push({ name, title: name + " in colour", trace: surface(model, { intensity, cmin: 0, cmax, colorscale: "Viridis", colorbar }) });
  };
  if (model.error) coloured("error", "error, mm", ...model.error);
  if (model.confidence) coloured("confidence", "confidence", model.confidence, 1);
  if (truth) all.push({ name: "truth", trace: surface(truth, { color: style("--truth"), opacity: 0.4 }) });
  all.push({ name: "skeleton", trace: lines(skeleton, style("--skeleton"), 6) });
  all.push({ name: "boundary", shown: true, trace: lines(boundary, style("--boundary"), 4) });
  return all.map((item) => ({ title: item.name, shown: false, ...item }));
}

// From where the model is looked at; the left camera looks along z, and y runs down.
// Where the part is high and narrow it is from farther away.
const far = ({ clientWidth, clientHeight }) => 1.9 * Math.max(1, (1.15 * clientHeight) / clientWidth);
const length = ({ x, y, z }) => Math.hypot(x, y, z);
const camera = (x, y, z) => {
  const scale = far(byId("space")) / length({ x, y, z });
  return { up: { x: 0, y: -1, z: 0 }, center: { x: 0, y: 0, z: 0 }, eye: { x: x * scale, y: y * scale, z: z * scale } };
};

// From where it is looked at now, if it is.
const eyes = () => structuredClone(byId("space")._fullLayout?.scene?.camera);

function drawSpace({ space }) {
  byId("space-part").hidden = !space;
  if (!space) return;
  const all = traces(space);
  switches(byId("traces"), all, () => drawSpace({ space }));
  const on = shown(byId("traces"));
  // Of models in the same place one is drawn, the last in colour if any; and it hides what is within.
  const models = ["confidence", "error", "model"].filter((name) => on.has(name));
  models.slice(1).forEach((name) => on.delete(name));
  const opacity = on.has("skeleton") || on.has("truth") ? 0.5 : 1;
  for (const { name, trace } of all) if (name === models[0]) trace.opacity = opacity;
  const axis = (text) => ({ title: { text }, gridcolor: style("--line"), zeroline: false, color: style("--faint"), showbackground: false });
  const layout = {
    scene: { aspectmode: "data", xaxis: axis("x, mm"), yaxis: axis("y, mm"), zaxis: axis("z, mm"), camera: eyes() ?? camera(-0.45, -0.4, -1) },
    margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)",
    font: { color: style("--ink") },
  };
  Plotly.react("space", all.map(({ name, trace }) => ({ name, ...trace, visible: on.has(name) })), layout, config);
}

// The model turned by keys, and put upright by buttons.
function turn(key) {
  const { eye } = eyes();
  const distance = length(eye);
  let [round, up, scale] = [Math.atan2(eye.x, -eye.z), Math.asin(-eye.y / distance), distance / far(byId("space"))];
  const step = Math.PI / 18;
  if (key === "ArrowLeft") round += step;
  else if (key === "ArrowRight") round -= step;
  else if (key === "ArrowUp") up = Math.min(up + step, 1.5);
  else if (key === "ArrowDown") up = Math.max(up - step, -1.5);
  else if (key === "+" || key === "=") scale *= 0.9;
  else if (key === "-") scale /= 0.9;
  else return false;
  const at = camera(Math.sin(round) * Math.cos(up), -Math.sin(up), -Math.cos(round) * Math.cos(up));
  for (const axis of "xyz") at.eye[axis] *= scale;
  Plotly.relayout("space", { "scene.camera": at });
  return true;
}
byId("space").addEventListener("keydown", (event) => { if (turn(event.key)) event.preventDefault(); });
byId("turns").addEventListener("click", ({ target }) => {
  if (target.dataset.eye) Plotly.relayout("space", { "scene.camera": camera(...target.dataset.eye.split(",").map(Number)) });
});

// Plots are as large as their places, whatever changes these; the model is as large in its place as it was.
const places = new ResizeObserver((entries) => entries.forEach(({ target }) => fit(target)));
async function fit(plot) {
  if (!plot._fullLayout || !plot.clientWidth) return;
  const { width, height, scene } = plot._fullLayout;
  const near = scene && length(scene.camera.eye) / far({ clientWidth: width, clientHeight: height });
  await Plotly.Plots.resize(plot);
  if (!scene) return;
  const at = eyes();
  const scale = (near * far(plot)) / length(at.eye);
  for (const axis of "xyz") at.eye[axis] *= scale;
  Plotly.relayout(plot, { "scene.camera": at });
}
for (const plot of document.querySelectorAll(".plot")) places.observe(plot);

function drawViews({ views }) {
  byId("views-part").hidden = !views.figures.length;
  switches(byId("layers"), views.layers, () => showLayers(views));
  byId("views").replaceChildren(...views.figures.map(({ name, frame, layers }) => {
    const figure = element("figure");
    const groups = layers.map(([layer, svg]) => `<g class="layer ${layer}">${svg}</g>`);
    figure.innerHTML = `<svg viewBox="${frame.join(" ")}" role="img" aria-label="the ${name} view">${groups.join("")}</svg>`;
    figure.append(element("figcaption", {}, name));
    return figure;
  }));
  showLayers(views);
}

function showLayers({ layers }) {
  const on = shown(byId("layers"));
  for (const { name } of layers) {
    for (const group of byId("views").getElementsByClassName(name)) group.style.display = on.has(name) ? "" : "none";
  }
  const told = layers.filter(({ name, caption }) => on.has(name) && caption);
  byId("captions").replaceChildren(...told.flatMap(({ title, caption }) => [element("dt", {}, title), element("dd", {}, caption)]));
}

// Colours follow the page, also when that changes between day and night.
function flat(x, y) {
  const axis = (text) => ({ title: { text }, gridcolor: style("--line"), zerolinecolor: style("--line"), fixedrange: true });
  return {
    margin: { l: 60, r: 10, t: 30, b: 45 }, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { color: style("--ink") }, xaxis: axis(x), yaxis: { ...axis(y), type: "log", dtick: 1 },
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" }, hovermode: "x",
  };
}

function drawHistogram({ histograms }) {
  byId("histogram-part").hidden = !histograms.length;
  if (!histograms.length) return;
  const layout = flat("grey value", "pixels");
  const sides = ["left", "right"].map((name) => ({ name, color: style("--" + name) }));
  layout.shapes = histograms.map(([, level], k) => (
    { type: "line", x0: level + 0.5, x1: level + 0.5, yref: "paper", y0: 0, y1: 1, line: { color: sides[k].color, dash: k ? "dot" : "dash" } }
  ));
  const drawn = histograms.map(([counts, level], k) => ({
    type: "scatter", mode: "lines", line: { shape: "hvh", color: sides[k].color, width: 1.5, dash: k ? "dot" : "solid" },
    name: `${sides[k].name}, threshold ${level}`, y: counts,
  }));
  Plotly.react("histogram", drawn, layout, config);
}

function drawInvariants({ invariants }) {
  byId("invariants-part").hidden = !invariants;
  if (!invariants) return;
  const { values, chosen, ways } = invariants;
  const bars = {
    type: "bar", y: values.map((value) => Math.max(value, 1e-4)),
    marker: { color: values.map((_, k) => style(k === chosen ? "--right" : "--left")) },
  };
  Plotly.react("invariants", [bars], flat(`${ways}; chosen: ${chosen}`, "e_omega, logarithmic"), config);
}

const cell = (text, number) => element("td", { className: number ? "number" : "" }, text);
const row = (...cells) => element("tr", {}, ...cells);
const said = (value) =>
  value === null ? "\u2013" : typeof value === "number" && !Number.isInteger(value) ? value.toPrecision(6) : String(value);

function tellTimes({ times }) {
  byId("times-part").hidden = !times.length;
  const longest = Math.max(...times.map(([, , ms]) => ms));
  const part = (name) => {
    const rows = times.filter(([of]) => of === name).map(([, stage, ms]) => {
      const bar = element("div");
      bar.style.width = (100 * ms) / longest + "%";
      return row(cell(stage), cell(ms.toFixed(2) + " ms", true), element("td", { className: "bar" }, bar));
    });
    return element("table", {}, element("caption", {}, name), ...rows);
  };
  byId("times").replaceChildren(...[...new Set(times.map(([of]) => of))].map(part));
}

// Every figure of report.json, folded by what it belongs to; what is in `open` is unfolded.
function tell(value, into, open) {
  const nested = (x) => x !== null && typeof x === "object";
  const [rows, folded] = [[], []];
  for (const [name, inner] of Object.entries(value)) {
    if (nested(inner) && (!Array.isArray(inner) || inner.some(nested))) {
      const details = element("details", {}, element("summary", {}, name));
      details.addEventListener("toggle", () => tell(inner, details, open), { once: true });
      details.open = open.has(name);
      folded.push(details);
    } else {
      rows.push(row(cell(name), cell(Array.isArray(inner) ? inner.map(said).join(", ") : said(inner))));
    }
  }
  into.append(...(rows.length ? [element("table", {}, ...rows)] : []), ...folded);
}

function tellNumbers({ report }) {
  byId("numbers-part").hidden = !report;
  const open = [...byId("numbers").querySelectorAll("details[open] > summary")].map((summary) => summary.textContent);
  byId("numbers").replaceChildren();
  if (report) tell(report, byId("numbers"), new Set(open));
}

const PARTS = [tellHead, drawSpace, drawViews, drawHistogram, drawInvariants, tellTimes, tellNumbers];
const SIGHT = matchMedia("(prefers-color-scheme: dark)");

function show(content) {
  const all = () => PARTS.forEach((part) => part(content));
  all();
  SIGHT.onchange = all;
  onhashchange = () => { obeyAddress(); all(); };
}

const first = JSON.parse(byId("data").textContent);
// A live page has none yet.
if (first) show(first);
if (first && location.hash) onhashchange();
