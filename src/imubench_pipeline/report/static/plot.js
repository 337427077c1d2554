// Figures: drawn when they come into view, again when units, colours or choices change.
// A kind of figure is a pure function (figure) -> { traces, layout, groups }; `groups` are what
// can be switched on and off, and serve as the legend.

const kinds = {};
const choices = new WeakMap(); // figure -> Map of group -> shown
const drawn = new Set();
let pageData = null;
let decoded = [];

const array = (place) => (decoded[place] ??= decode(...pageData.arrays[place]));

// Kinds of arrays: f, float32 as they are; l and e, levels of a logarithm and even ones, of which
// 0 stands for no value.
function decode(kind, low, step, text) {
  const bytes = Uint8Array.from(atob(text), (sign) => sign.charCodeAt(0));
  if (kind === "f") return [...new Float32Array(bytes.buffer)];
  return Array.from(kind === "e" ? bytes : summed(bytes), (level) => {
    if (level === 0) return NaN;
    const value = low + (level - 1) * step;
    return kind === "l" ? 10 ** value : value;
  });
}

// Differences modulo 65536, all low bytes before all high ones.
function summed(bytes) {
  const levels = new Uint16Array(bytes.length / 2);
  let level = 0;
  for (let i = 0; i < levels.length; i += 1) {
    level += bytes[i] + 256 * bytes[i + levels.length];
    levels[i] = level;
  }
  return levels;
}

const scaled = (place, factor) => array(place).map((value) => value * factor);
const printing = () => window.matchMedia("print").matches || document.documentElement.dataset.printing === "yes";
const dark = () => !printing() && window.matchMedia("(prefers-color-scheme: dark)").matches;

function inks() {
  return dark()
    ? { ink: "#e8e8e8", soft: "#a9b1b8", grid: "#3a424a", paper: "#161a1e", mark: "#ff8f8f" }
    : { ink: "#1b1b1b", soft: "#5a636b", grid: "#dfe3e6", paper: "#ffffff", mark: "#b3001b" };
}

const colourOf = (look) => (dark() ? look.dark : look.light);

function faint(colour, opacity) {
  const parts = [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
  return `rgba(${parts.join(",")},${opacity})`;
}

function line(x, y, look, more = {}) {
  const style = { color: colourOf(look), dash: look.dash ?? "solid", width: look.width ?? 1.8 };
  return { type: "scatter", mode: "lines", x, y, hoverinfo: "skip", line: style, ...more };
}

function band(x, low, high, look, opacity = 0.18, more = {}) {
  const edge = { type: "scatter", mode: "lines", x, hoverinfo: "skip", line: { width: 0, color: colourOf(look) }, ...more };
  const fillcolor = faint(colourOf(look), opacity);
  const present = x.map((_, i) => Number.isFinite(low[i]) && Number.isFinite(high[i]));
  const stretches = present.filter((inside, i) => inside && !present[i - 1]).length;
  if (stretches < 2) return [{ ...edge, y: low }, { ...edge, y: high, fill: "tonexty", fillcolor }];
  // "tonexty" would bridge gaps, so each segment is a shape of its own.
  const shapes = { x: [], y: [] };
  for (let first = 0; first < x.length; first += 1) {
    if (!present[first]) continue;
    let stop = first;
    while (present[stop]) stop += 1;
    const own = x.slice(first, stop);
    shapes.x.push(...own, ...[...own].reverse(), null);
    shapes.y.push(...low.slice(first, stop), ...high.slice(first, stop).reverse(), null);
    first = stop;
  }
  return [{ ...edge, ...shapes, fill: "toself", fillcolor }];
}

const tickText = (value) => (value >= 1e-3 && value < 1e5 ? numberText(value, 3) : numberText(value, 3).replace(/^1×/, ""));

// Labels at decades, at 1, 2, 5 or at even steps, as many as can be read; lines at all multiples.
function logTicks(low, high) {
  const span = high - low;
  const decades = Array.from({ length: Math.ceil(high) - Math.floor(low) + 1 }, (_, i) => Math.floor(low) + i);
  let tickvals;
  if (span > 2.2) {
    const step = Math.ceil(span / 8);
    tickvals = decades.filter((power) => power % step === 0).map((power) => 10 ** power);
  } else if (span > 0.75) {
    tickvals = decades.flatMap((power) => [1, 2, 5].map((each) => each * 10 ** power));
  } else {
    const width = 10 ** high - 10 ** low;
    const rough = 10 ** Math.floor(Math.log10(width / 4));
    const step = [1, 2, 5, 10].map((each) => each * rough).find((each) => width / each <= 5);
    const first = Math.ceil(10 ** low / step);
    tickvals = Array.from({ length: 6 }, (_, i) => (first + i) * step);
  }
  tickvals = tickvals.filter((value) => value >= 10 ** low && value <= 10 ** high);
  const every = decades.flatMap((power) => [2, 3, 4, 5, 6, 7, 8, 9].map((each) => each * 10 ** power));
  return { tickvals, ticktext: tickvals.map(tickText), minor: every };
}

function linearAxis(title) {
  const { ink, grid } = inks();
  return { title: { text: title, standoff: 8 }, color: ink, gridcolor: grid, zeroline: false, automargin: true };
}

function logAxis(title, range) {
  const { tickvals, ticktext, minor } = logTicks(...range);
  return {
    ...linearAxis(title), type: "log", range, tickmode: "array", tickvals, ticktext, tickangle: 0,
    minor: { tickmode: "array", tickvals: minor, showgrid: true, gridcolor: faint(inks().grid, 0.55), ticks: "" },
  };
}

// The decades that hold all values above 0, with some room.
function logRange(values, below, above = below) {
  let [least, most] = [Infinity, -Infinity];
  for (const value of values) {
    if (value > 0 && value < least) least = value;
    if (value > most && Number.isFinite(value)) most = value;
  }
  return least <= most ? [Math.log10(least) - below, Math.log10(most) + above] : [0, 1];
}

// Labels follow when the reader zooms.
function followZoom(figure, canvas) {
  canvas.on("plotly_relayout", (changes) => {
    const update = {};
    noteZoom(figure, canvas, changes);
    for (const name of axesOf(canvas.layout)) {
      const axis = canvas.layout[name];
      if (axis.type !== "log" || !Object.keys(changes).some((key) => key.startsWith(`${name}.range`))) continue;
      const { tickvals, ticktext } = logTicks(...axis.range);
      Object.assign(update, { [`${name}.tickvals`]: tickvals, [`${name}.ticktext`]: ticktext });
    }
    if (Object.keys(update).length > 0) Plotly.relayout(canvas, update);
  });
}

function baseLayout() {
  const { ink, paper } = inks();
  return {
    margin: { l: 60, r: 14, t: 14, b: 50 }, showlegend: false, hovermode: "closest",
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: "system-ui, sans-serif", size: printing() ? 10 : 13, color: ink },
    hoverlabel: { bgcolor: paper, bordercolor: ink, font: { color: ink } },
  };
}

const shown = (figure, group) => choices.get(figure)?.get(group) ?? true;

const isOn = (trace, on) => [trace.group].flat().every((group) => !group || on(group));

// Groups that are on when the page opens, by its address.
function openingChoices(figure, groups) {
  const other = new Set((state.get(`g${numberOf(figure)}`) ?? "").split("~"));
  return new Map(groups.map((group) => [group.key, group.on !== other.has(group.key)]));
}

function drawFigure(figure) {
  const made = kinds[figure.dataset.kind](figure);
  const own = choices.get(figure) ?? new Map();
  const fresh = made.groups.filter((group) => !own.has(group.key));
  if (fresh.length > 0 || !choices.has(figure)) {
    openingChoices(figure, fresh).forEach((on, key) => own.set(key, on));
    choices.set(figure, own);
    drawControls(figure, fresh);
    return drawFigure(figure);
  }
  syncControls(figure, made.groups);
  // The choices that differ from those with which the page opens.
  keepIfOther(`g${numberOf(figure)}`, made.groups.filter((group) => own.get(group.key) !== group.on).map((group) => group.key).join("~"));
  const traces = made.traces.filter((trace) => isOn(trace, (group) => shown(figure, group)));
  const canvas = figure.querySelector(".canvas");
  canvas.classList.toggle("empty", traces.length === 0);
  const layout = { ...baseLayout(), ...made.layout, datarevision: Math.random() };
  const paper = printing() ? onPaper(figure) : null;
  const height = made.height ?? paper?.height;
  canvas.style.height = height ? `${height}px` : "";
  canvas.style.width = paper ? `${paper.width}px` : "";
  if (paper) Object.assign(layout, { width: paper.width, height });
  wholes.set(figure, Object.fromEntries(axesOf(layout).map((name) => [name, `${layout[name].range}`])));
  zoomIn(figure, layout);
  const first = !drawn.has(figure);
  drawn.add(figure);
  if (figure.dataset.sketched) canvas.replaceChildren();
  delete figure.dataset.sketched;
  Plotly.react(canvas, traces.map(({ group, ...trace }) => trace), layout, {
    displayModeBar: false, responsive: true, doubleClick: "reset", showTips: false,
  });
  if (first) {
    followZoom(figure, canvas);
    kinds[figure.dataset.kind].started?.(figure, canvas);
  }
  drawTools(figure);
  showZoom(figure);
}

const DASHES = { solid: "", dash: "6 4", dot: "2 3", dashdot: "7 3 2 3", longdash: "11 4", longdashdot: "11 3 2 3", "11px,3px,5px,3px": "11 3 5 3", "7px,3px,2px,3px,2px,3px": "7 3 2 3 2 3" };
const SHAPES = {
  circle: '<circle cx="14" cy="7" r="4"/>', square: '<rect x="10" y="3" width="8" height="8"/>',
  diamond: '<path d="M14 2l5 5-5 5-5-5z"/>', "triangle-up": '<path d="M14 2l5 9H9z"/>',
  "triangle-down": '<path d="M14 12l5-9H9z"/>', cross: '<path d="M12.5 2h3v3.5H19v3h-3.5V12h-3V8.5H9v-3h3.5z"/>',
  star: '<path d="M14 1.5l1.5 4h4l-3.2 2.5 1.2 4-3.5-2.4-3.5 2.4 1.2-4L8.5 5.5h4z"/>',
  x: '<path d="M10 4l1.6-1.6L14 5l2.4-2.6L18 4l-2.5 3 2.5 3-1.6 1.6L14 9l-2.4 2.6L10 10l2.5-3z"/>',
};

function swatch(look) {
  const colour = colourOf(look);
  const mark = look.marker ? `<g fill="${colour}">${SHAPES[look.marker]}</g>` : "";
  const body = look.filled
    ? `<rect y="2" width="28" height="10" fill="${colour}" opacity=".35"/>`
    : `<line x1="0" y1="7" x2="28" y2="7" stroke="${colour}" stroke-width="2" stroke-dasharray="${DASHES[look.dash ?? "solid"]}"/>`;
  return `<svg class="swatch" aria-hidden="true" viewBox="0 0 28 14" width="28" height="14">${look.line === false ? "" : body}${mark}</svg>`;
}

function drawControls(figure, groups) {
  const controls = figure.querySelector(".controls");
  if (!controls) return;
  for (const group of groups) {
    const box = element("input", { type: "checkbox", checked: shown(figure, group.key), onchange: () => {
      choices.get(figure).set(group.key, box.checked);
      redrawChosen(figure);
    } });
    const label = element("label", { className: "toggle" }, box, element("span"), ` ${group.label}`);
    label.dataset.group = group.key;
    controls.append(label);
  }
  if (groups.length > 8) controls.append(allOrNone(figure, groups, true), allOrNone(figure, groups, false));
}

// The choice of curves also applies to the other figures of the page.
const redrawChosen = (figure) => (figure.dataset.kind === "overlay" ? redrawAll() : drawFigure(figure));

// Layers, such as the curves themselves, stay on: without them no curve would be visible.
function allOrNone(figure, groups, on) {
  return element("button", { type: "button", textContent: on ? "all on" : "all off", onclick: () => {
    for (const { key } of groups.filter(({ layer }) => !layer)) {
      choices.get(figure).set(key, on);
      figure.querySelector(`.controls [data-group="${CSS.escape(key)}"] input`).checked = on;
    }
    redrawChosen(figure);
  } });
}

// Colours follow the theme; groups without data are hidden.
function syncControls(figure, groups) {
  const byKey = new Map(groups.map((group) => [group.key, group]));
  figure.querySelectorAll(".controls .toggle").forEach((label) => {
    const group = byKey.get(label.dataset.group);
    label.hidden = !group || group.absent === true;
    if (group) label.querySelector("span").innerHTML = group.look ? swatch(group.look) : "";
  });
}

const watcher = new IntersectionObserver(
  (entries) => entries.forEach((entry) => {
    if (!entry.isIntersecting) return;
    watcher.unobserve(entry.target);
    drawFigure(entry.target);
    entry.target.dataset.drawn = "yes";
  }),
  { rootMargin: "300px" },
);

// The drawing script is large, so it is loaded after the page.
let plotting = null;

function loadPlotting() {
  plotting ??= window.Plotly ? Promise.resolve() : new Promise((loaded) => {
    const place = document.body.dataset.plotting;
    if (place) document.head.append(element("script", { src: place, onload: loaded }));
    else window.addEventListener("load", loaded, { once: true });
  });
  return plotting;
}

function startFigures(root) {
  drawn.clear();
  watcher.disconnect();
  const figures = [...root.querySelectorAll("figure[data-kind]")];
  if (figures.length === 0) return;
  if (!window.Plotly) sketchFigures(figures);
  afterPaint(() => loadPlotting().then(() => figures.forEach((figure) => watcher.observe(figure))));
}

// A page in the background is not painted, so it does not wait for painting.
function afterPaint(act) {
  let done = false;
  const once = () => {
    if (done) return;
    done = true;
    performance.mark("painted");
    act();
  };
  window.requestAnimationFrame(() => window.setTimeout(once));
  window.setTimeout(once, 300);
}

const redrawAll = () => [...drawn].filter((figure) => figure.isConnected).forEach(drawFigure);

// Figures do not learn the width of a printed page in time, so it is fixed. Those of a channel are
// printed in pairs.
const onPaper = (figure) => (figure.matches("section.channel .figures > *") ? { width: 330, height: 200 } : { width: 660, height: 240 });

function startPrinting() {
  const everyFigure = () => document.querySelectorAll("figure[data-kind]:not(.on-screen *)");
  window.addEventListener("beforeprint", () => {
    document.documentElement.dataset.printing = "yes";
    document.querySelectorAll("details:not([open]):not(.on-screen)").forEach((each) => {
      each.dataset.closed = "yes";
      each.open = true;
    });
    if (window.Plotly) everyFigure().forEach(drawFigure);
  });
  window.addEventListener("afterprint", () => {
    document.documentElement.dataset.printing = "no";
    document.querySelectorAll("details[data-closed]").forEach((each) => {
      each.open = false;
      delete each.dataset.closed;
    });
    if (window.Plotly) everyFigure().forEach((figure) => drawn.has(figure) && drawFigure(figure));
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);
}
