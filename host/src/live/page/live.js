
// A live page: it asks for the pair after the one that it has drawn, so that it is never behind, and says what is set.
const home = location.pathname.replace(/\/?$/, "/");
const later = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const drawn = () => new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
const cameras = [...document.querySelectorAll(".camera")];
// Of the last pair: its number, and its views' size, px.
let last = 0;
let size = null;
let skipped = 0;
let times = [];
// What is set, as the program says it.
let settings = null;
// What is shown.
let content = null;

function state(kind, words) {
  byId("state").className = kind;
  byId("state").textContent = words;
}

function put(next) {
  content = next.content;
  // Before anything is drawn: until now the page was hidden below this.
  if (content.reached === null) state("going", "live");
  else state("refused", "refused: " + content.gates[0].sentence);
  show(content);
  if (!last && location.hash) onhashchange();
  byId("gates").prepend(...next.remarks.map((remark) => element("li", { className: "warning" }, remark)));
  putPictures(next.pictures);
  tellSettings(next.settings);
}

function putPictures(pictures) {
  byId("cameras").hidden = !pictures;
  if (!pictures) return;
  const [[width, height], addresses] = pictures;
  size = [width, height];
  cameras.forEach((svg, k) => {
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const image = svg.querySelector("image");
    for (const [name, value] of [["width", width], ["height", height], ["href", addresses[k]]]) image.setAttribute(name, value);
  });
}

function gauge(next, latency) {
  if (last) skipped += next.number - last - 1;
  const now = performance.now();
  times = [...times.filter((time) => now - time < 3000), now];
  const rate = times.length > 1 ? (times.length - 1) / (now - times[0]) * 1000 : null;
  const a_second = (value) => (value ? value.toFixed(1) + " a second" : "–");
  byId("pair").textContent = next.name;
  byId("rate").textContent = a_second(next.rate);
  byId("drawn").textContent = a_second(rate);
  // The first one may have waited for this page to be opened.
  byId("latency").textContent = last ? latency.toFixed(0) + " ms" : "–";
  byId("skipped").textContent = skipped;
  byId("dropped").textContent = next.dropped;
}

async function follow() {
  for (;;) {
    // Nobody looks: then nothing is made for us.
    while (document.hidden || byId("hold").checked) await later(200);
    let answer;
    try {
      answer = await fetch(home + "pair?after=" + last);
    } catch {
      state("ended", "the program has ended; start it again and open the address that it prints then");
      await later(1000);
      continue;
    }
    const begun = performance.now();
    let next;
    try {
      if (answer.status === 204) continue;
      if (answer.status !== 200) {
        state("ended", await answer.text());
        await later(2000);
        continue;
      }
      next = await answer.json();
      // The pair before may have been held while this one was waited for.
      if (byId("hold").checked) continue;
      put(next);
      await drawn();
      gauge(next, Number(answer.headers.get("ossature-age-ms")) + performance.now() - begun);
    } catch (error) {
      state("refused", "this pair could not be drawn: " + error.message);
      if (!next) await later(1000);
    }
    if (next) last = next.number;
  }
}

// What is wanted and not yet said; what is wanted later replaces it.
let wish = null;
let saying = false;
async function want(more) {
  wish = { ...wish, ...more };
  if (saying) return;
  saying = true;
  while (wish) {
    const body = JSON.stringify(wish);
    wish = null;
    try {
      const answer = await fetch(home + "settings", { method: "POST", body });
      byId("complaint").textContent = answer.ok ? "" : await answer.text();
      if (answer.ok) settings = await answer.json();
    } catch (error) {
      byId("complaint").textContent = "not set: " + error.message;
    }
  }
  saying = false;
  tellSettings(settings);
}

// Shows what is set, unless it is older than what is known, or being changed here.
function tellSettings(now) {
  if (!now || saying || (settings && now.version < settings.version)) return;
  settings = now;
  for (const name of ["threshold", "polarity", "region", "exposure"]) {
    const { why } = now[name];
    byId("set-" + name).disabled = Boolean(why);
    byId("set-" + name).querySelector(".why").textContent = why ?? "";
  }
  const level = now.threshold.value === "otsu" ? content?.histograms[0]?.[1] : Number(now.threshold.value);
  byId("otsu").checked = now.threshold.value === "otsu";
  byId("level").value = level ?? 128;
  byId("level-is").textContent = level ?? "";
  byId("polarity").value = now.polarity.value;
  if (document.activeElement !== byId("region")) byId("region").value = now.region.value ?? "";
  cameras.forEach((svg) => svg.classList.toggle("fixed", Boolean(now.region.why)));
  if (!drawing) outline(parsed(now.region.value));
  const { least, most, unit, auto, value } = now.exposure;
  const fixed = value !== null && value !== "auto";
  Object.assign(byId("exposure"), { min: least ?? 0, max: most ?? 1 });
  byId("exposure").value = fixed ? value : least ?? 0;
  byId("exposure-is").textContent = fixed ? `${value} ${unit}` : "";
  byId("exposure-auto").checked = value === "auto";
  byId("exposure-auto").parentElement.hidden = !auto;
  byId("as-flags").hidden = !now.flags;
  byId("flags").textContent = now.flags;
}

byId("settings").addEventListener("submit", (event) => event.preventDefault());
byId("level").addEventListener("input", () => {
  byId("level-is").textContent = byId("level").value;
  byId("otsu").checked = false;
  want({ threshold: byId("level").value });
});
byId("otsu").addEventListener("change", () => want({ threshold: byId("otsu").checked ? "otsu" : byId("level").value }));
byId("polarity").addEventListener("change", () => want({ polarity: byId("polarity").value }));
byId("region").addEventListener("change", () => want({ region: byId("region").value }));
byId("whole").addEventListener("click", () => { byId("region").value = ""; want({ region: "" }); });
byId("exposure").addEventListener("input", () => {
  byId("exposure-is").textContent = byId("exposure").value;
  byId("exposure-auto").checked = false;
  want({ exposure: byId("exposure").value });
});
byId("exposure-auto").addEventListener("change", () => want({ exposure: byId("exposure-auto").checked ? "auto" : byId("exposure").value }));

// A region as numbers, or null for all.
const parsed = (text) => (text ? text.split(",").map(Number) : null);

// Shows a region in both views: it is the same rectangle.
function outline(region) {
  if (!size) return;
  const [x, y, width, height] = region ?? [0, 0, ...size];
  const whole = `M0 0H${size[0]}V${size[1]}H0Z`;
  for (const svg of cameras) {
    const rect = svg.querySelector(".region");
    for (const [name, value] of Object.entries({ x, y, width, height })) rect.setAttribute(name, value);
    rect.style.display = region ? "" : "none";
    svg.querySelector(".outside").setAttribute("d", region ? `${whole}M${x} ${y}h${width}v${height}h${-width}Z` : "");
  }
}

// Where a rectangle was begun, px, and the rectangle so far.
let drawing = null;
function place(svg, event) {
  const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  return [at.x, at.y].map((c, axis) => Math.min(Math.max(Math.round(c), 0), size[axis]));
}
for (const svg of cameras) {
  svg.addEventListener("pointerdown", (event) => {
    if (!size || settings?.region.why || event.button !== 0) return;
    svg.setPointerCapture(event.pointerId);
    drawing = { from: place(svg, event), region: null };
  });
  svg.addEventListener("pointermove", (event) => {
    if (!drawing) return;
    const to = place(svg, event);
    const low = to.map((c, axis) => Math.min(c, drawing.from[axis]));
    drawing.region = [...low, ...to.map((c, axis) => Math.abs(c - drawing.from[axis]))];
    outline(drawing.region);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    svg.addEventListener(end, () => {
      const region = drawing?.region;
      drawing = null;
      // A click is no rectangle.
      if (end === "pointerup" && region && Math.min(region[2], region[3]) > 3) want({ region: region.join(",") });
      else outline(parsed(settings?.region.value));
    });
  }
}

follow();
