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

const pen = document.createElement("canvas").getContext("2d");

function textSize(text, size) {
  pen.font = `${size}px system-ui, sans-serif`;
  const lines = text.split("<br>").map(plainText);
  return [Math.max(...lines.map((each) => pen.measureText(each).width)), lines.length * size * 1.3];
}

// Pixels of a value on an axis of a figure of some size.
function pixelsOn(layout, name, [width, height]) {
  const { l, r, t, b } = layout.margin;
  const { range, type, domain = [0, 1] } = layout[name];
  const [from, to] = name[0] === "x" ? [l, width - r] : [height - b, t];
  return (value) => from + (to - from) * (domain[0] + (domain[1] - domain[0]) * (((type === "log" ? Math.log10(value) : value) - range[0]) / (range[1] - range[0])));
}

// Tick labels of a logarithmic axis: every second or third where they would touch.
function thinTicks(layout, size) {
  for (const name of axesOf(layout).reverse()) {
    const { type, range, tickvals, ticktext } = layout[name];
    if (type !== "log" || !range || !tickvals) continue;
    // Room for the labels of y, before places are calculated.
    if (name === "yaxis") layout.margin = { ...layout.margin, l: Math.max(layout.margin.l, 42 + Math.max(...ticktext.map((text) => textSize(text, layout.font.size)[0]))) };
    const place = pixelsOn(layout, name, size);
    const sides = ticktext.map((text) => textSize(text, layout.font.size)[name[0] === "x" ? 0 : 1]);
    const fits = (step) => tickvals.every((value, i) => i % step > 0 || i + step >= tickvals.length
      || Math.abs(place(tickvals[i + step]) - place(value)) > (sides[i] + sides[i + step]) / 2 + (name[0] === "x" ? 7 : 1));
    const step = [1, 2, 3, 4, 5, 6].find(fits) ?? 7;
    // The lowest label of y would touch the first one of x.
    const inCorner = (value) => name[0] === "y" && size[1] - layout.margin.b - place(value) < 10;
    layout[name] = { ...layout[name], ticktext: ticktext.map((text, i) => (i % step === 0 && !inCorner(tickvals[i]) ? text : "")) };
  }
}

// Annotations for labels { x, y, text, colour } at places where they cover neither each other nor,
// if possible, a curve; a line leads to the point. Labels with `span` are beside the axes, within
// that range of y.
function placeLabels(labels, layout, size, traces) {
  const [px, py] = ["xaxis", "yaxis"].map((name) => pixelsOn(layout, name, size));
  const { l, r, t, b } = layout.margin;
  const inside = [l, t, size[0] - r, size[1] - b];
  const crosses = (one, other) => one[0] < other[2] && other[0] < one[2] && one[1] < other[3] && other[1] < one[3];
  const points = [];
  for (const { x, y, fill, line: edge } of traces) {
    if (fill || edge?.width === 0) continue;
    let before = null;
    for (let i = 0; i < x.length; i += 1) {
      const at = [px(x[i]), py(y[i])];
      const far = before ? Math.hypot(at[0] - before[0], at[1] - before[1]) : 0;
      for (let part = Math.min(200, Math.ceil(far / 6)) || 1; Number.isFinite(at[0] + at[1]) && part > 0; part -= 1) {
        const share = before ? part / (Math.ceil(far / 6) || 1) : 1;
        points.push(before ? [before[0] + share * (at[0] - before[0]), before[1] + share * (at[1] - before[1])] : at);
      }
      before = Number.isFinite(at[0] + at[1]) ? at : null;
    }
  }
  const taken = [];
  const made = [];
  const fontSize = Math.min(layout.font.size, 12);
  for (const { x, y, text, colour, span } of labels) {
    const [wide, high] = textSize(text, fontSize).map((side) => side + 4);
    const boxAt = (left, level) => [left - wide / 2, level - high / 2, left + wide / 2, level + high / 2];
    const font = { size: fontSize, color: colour };
    if (span) {
      const [low, top] = span.map((end) => Math.min(inside[3], Math.max(inside[1], py(end))));
      const box = boxAt(inside[2] + 4 + wide / 2, (low + top) / 2);
      if (low - top < high || taken.some((other) => crosses(box, other))) continue;
      taken.push(box);
      made.push({ xref: "paper", x: 1, xshift: 4, yref: "paper", y: (inside[3] - (low + top) / 2) / (inside[3] - inside[1]), xanchor: "left", yanchor: "middle", text, showarrow: false, font });
      continue;
    }
    const [left, level] = [px(x), py(y)];
    if (!crosses([left, level, left, level].map((each, i) => each + (i < 2 ? -1 : 1)), inside)) continue;
    let best = null;
    for (const far of [12, 24, 40, 60, 85, 115, 150]) {
      for (let turn = 0; turn < 16; turn += 1) {
        const [ax, ay] = [(far + wide / 2) * Math.cos((turn * Math.PI) / 8), -(far + high / 2) * Math.sin((turn * Math.PI) / 8)];
        const box = boxAt(left + ax, level + ay);
        if (box[0] < inside[0] || box[1] < inside[1] || box[2] > inside[2] || box[3] > inside[3] || taken.some((other) => crosses(box, other))) continue;
        const cost = far + 12 * points.filter((point) => crosses([...point, ...point], box)).length;
        if (!best || cost < best.cost) best = { cost, ax, ay, box };
      }
    }
    if (!best) continue;
    taken.push(best.box);
    const [along, up] = [["xaxis", x], ["yaxis", y]].map(([name, value]) => (layout[name].type === "log" ? Math.log10(value) : value));
    made.push({
      xref: "x", yref: "y", x: along, y: up, ax: best.ax, ay: best.ay, xanchor: "center", yanchor: "middle", text, showarrow: true, standoff: 4,
      arrowhead: 0, arrowwidth: 1, arrowcolor: colour, font, bgcolor: faint(inks().paper, 0.8), borderpad: 1,
    });
  }
  return made;
}

// Light bands of the grades behind an Allan deviation: traces of the group "grades", and labels for
// the right margin, which should be GRADE_MARGIN wide.
const GRADE_MARGIN = 74;

function gradeBands(quantity, unit, ranges) {
  const { soft } = inks();
  const tau = Array.from({ length: 41 }, (_, i) => 10 ** (ranges.x[0] - 2 + (i / 40) * (ranges.x[1] - ranges.x[0] + 4)));
  const grades = Object.entries(GRADES[quantity]);
  const limit = ({ N, B }) => (time) => unit.factor * Math.hypot(N / Math.sqrt(time), FLOOR * B);
  const [top, bottom] = [10 ** (ranges.y[1] + 3), 10 ** (ranges.y[0] - 3)];
  const edges = [() => top, ...grades.map(([, of]) => limit(of)), () => bottom];
  const names = ["consumer", ...grades.map(([name]) => name)];
  const end = 10 ** ranges.x[1];
  return {
    traces: names.flatMap((name, i) => band(tau, tau.map(edges[i + 1]), tau.map(edges[i]), { light: soft, dark: soft }, 0.02 + 0.06 * i, { group: "grades", name: `${name} grade`, meta: { guide: true } })),
    labels: names.map((name, i) => ({ text: name, colour: soft, span: [edges[i + 1](end), edges[i](end)] })),
  };
}

// The points and slopes of N, B and K of one or more channels: traces of the group "marks", and a
// label each with the range of the values.
function noiseMarks(views, ranges) {
  const quantity = quantityOf(views[0].channel);
  const { ink, soft, paper } = inks();
  const level = unitOf(quantity, "adev");
  const made = { traces: [], labels: [] };
  const tau = [0, 1].map((side) => 10 ** ranges.x[side]);
  for (const [symbol, name, slope] of [["N", "N", -0.5], ["B_curve", "B", 0], ["K", "K", 0.5]]) {
    const first = (view, key) => view.parameters[view.recommended]?.[key]?.find(([value]) => value !== null);
    const of = (view) => first(view, symbol) ?? (symbol === "B_curve" ? first(view, "B") : undefined);
    const having = views.filter(of);
    const found = having.map(of);
    if (found.length === 0) continue;
    // The value of some axes is no value of all.
    const which = having.length < views.length ? ` (${having.map((view) => view.channel.split("_")[1]).join(", ")})` : "";
    const values = found.map(([value]) => value).sort((a, b) => a - b);
    const middle = Math.exp(values.reduce((sum, value) => sum + Math.log(value), 0) / values.length);
    const along = (time) => level.factor * middle * (slope < 0 ? time ** -0.5 : slope > 0 ? Math.sqrt(time / 3) : FLOOR);
    let at = { N: 1, B_curve: flatTime(views[0], FLOOR * middle), K: 3 }[symbol];
    const visible = (time) => time > tau[0] && time < tau[1] && Math.log10(along(time)) > ranges.y[0] && Math.log10(along(time)) < ranges.y[1];
    if (!visible(at)) at = slope > 0 ? tau[1] / 1.6 : tau[0] * 1.6;
    if (!visible(at)) continue;
    const ends = slope === 0 ? [at / 10, at * 10] : tau;
    const x = Array.from({ length: 31 }, (_, i) => ends[0] * (ends[1] / ends[0]) ** (i / 30)).filter((time) => Math.log10(along(time)) > ranges.y[0]);
    const guide = { group: "marks", name: `${name} (slope)`, meta: { guide: true } };
    made.traces.push(line(x, x.map(along), { light: soft, dark: soft, dash: "dash", width: 1 }, guide), {
      ...guide, type: "scatter", mode: "markers", x: [at], y: [along(at)], hoverinfo: "skip", marker: { color: paper, size: 9, line: { color: ink, width: 2 } },
    });
    const unit = unitOf(quantity, symbol);
    const [low, high] = [values[0], values.at(-1)].map((value) => numberText(value * unit.factor, 3));
    const text = low === high ? estimateTexts(...found[0].slice(0, 3), unit)[0] : `${low} to ${high}`;
    made.labels.push({ x: at, y: along(at), text: `<b>${name}</b> ${text} ${unit.sign}${which}`, colour: ink });
  }
  return made;
}

// The averaging time at which a curve is flat and nearest to a level.
function flatTime(view, level) {
  const [tau, size] = [array(view.tau), array(view.adev).map(Math.log)];
  const cost = (i) => Math.abs(size[i] - Math.log(level)) + Math.abs((size[i + 1] - size[i - 1]) / Math.log(tau[i + 1] / tau[i - 1]));
  return tau[tau.reduce((best, _, i) => (i > 0 && i + 1 < tau.length && !(cost(i) >= cost(best)) ? i : best), 1)];
}

// Labels of the figure, and what they must not cover, for another placement after a zoom.
const dressed = new WeakMap();

function dress(figure, layout, made, size) {
  thinTicks(layout, size);
  const labels = (made.labels ?? []).filter(({ group }) => !group || shown(figure, group));
  const own = layout.annotations ?? [];
  dressed.set(figure, { labels, own });
  if (labels.length > 0) layout.annotations = [...own, ...placeLabels(labels, layout, size, made.traces)];
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
    if (Object.keys(update).length > 0) {
      const { labels, own } = dressed.get(figure);
      if (labels.length > 0) update.annotations = [...own, ...placeLabels(labels, canvas.layout, [canvas.clientWidth, canvas.clientHeight], canvas.data)];
      Plotly.relayout(canvas, update);
    }
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
  dress(figure, layout, { ...made, traces }, [paper?.width ?? canvas.clientWidth, height ?? canvas.clientHeight]);
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
  const folded = element("details", { className: "more" }, element("summary", { textContent: "More" }));
  for (const group of groups) {
    const box = element("input", { type: "checkbox", checked: shown(figure, group.key), onchange: () => {
      choices.get(figure).set(group.key, box.checked);
      redrawChosen(figure);
    } });
    const label = element("label", { className: "toggle" }, box, element("span"), ` ${group.label}`);
    label.dataset.group = group.key;
    (group.more ? folded : controls).append(label);
  }
  if (folded.childElementCount > 1) controls.append(folded);
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
    everyFigure().forEach(window.Plotly ? drawFigure : sketchFigure);
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
  // Labels are placed for the size of a figure.
  let resizing;
  window.addEventListener("resize", () => {
    clearTimeout(resizing);
    resizing = setTimeout(() => printing() || redrawAll(), 200);
  });
}
