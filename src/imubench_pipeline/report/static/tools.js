// Tools of a figure: reset the zoom, save it as a picture, show or save its values.

const zooms = new WeakMap(); // figure -> axis -> { range, title }
const axesOf = (layout) => Object.keys(layout).filter((name) => /^[xy]axis\d*$/.test(name));
const numberOf = (figure) => [...document.querySelectorAll("figure[data-kind]")].indexOf(figure);

// The zoom is kept when units or choices change the figure.
function zoomIn(figure, layout) {
  if (!zooms.has(figure)) {
    const parts = (state.get(`z${numberOf(figure)}`) ?? "").split("~");
    const saved = {};
    for (let i = 0; i + 2 < parts.length; i += 3) {
      const ends = parts.slice(i + 1, i + 3);
      saved[parts[i]] = { range: ends.every((end) => !Number.isNaN(Number(end))) ? ends.map(Number) : ends, title: layout[parts[i]]?.title?.text };
    }
    zooms.set(figure, saved);
  }
  const zoom = zooms.get(figure);
  for (const [name, { range, title }] of Object.entries(zoom)) {
    const axis = layout[name];
    if (!axis || axis.title?.text !== title) delete zoom[name];
    else {
      const { tickvals, ticktext } = axis.type === "log" ? logTicks(...range) : axis;
      layout[name] = { ...axis, range, autorange: false, tickvals, ticktext };
    }
  }
}

function noteZoom(figure, canvas, changes) {
  const zoom = zooms.get(figure);
  for (const name of axesOf(canvas.layout)) {
    if (changes[`${name}.autorange`]) delete zoom[name];
    else if (`${name}.range[0]` in changes || `${name}.range` in changes) {
      zoom[name] = { range: [...canvas.layout[name].range], title: canvas.layout[name].title?.text };
    }
  }
  const whole = wholes.get(figure) ?? {};
  for (const name of Object.keys(zoom)) if (`${zoom[name].range}` === whole[name]) delete zoom[name];
  showZoom(figure);
}

const wholes = new WeakMap(); // figure -> axis -> range without zoom

function showZoom(figure) {
  const zoom = zooms.get(figure) ?? {};
  const text = Object.entries(zoom).map(([name, { range }]) => [name, ...range.map((end) => (typeof end === "number" ? Number(end.toPrecision(5)) : end))].join("~")).join("~");
  keepIfOther(`z${numberOf(figure)}`, text);
  const button = figure.querySelector(".tools .whole");
  if (button) button.hidden = text === "";
}

const keepIfOther = (key, text) => (state.get(key) ?? "") !== text && keep(key, text);

const slug = (text) => text.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-|-$/g, "").slice(0, 80);
const fileName = (figure, ending) => `${slug(`${document.querySelector("main h1")?.textContent ?? ""} ${figure.dataset.kind} ${figure.dataset.channel ?? figure.dataset.symbol ?? ""}`)}.${ending}`;

function save(address, name) {
  const link = element("a", { href: address, download: name });
  document.body.append(link);
  link.click();
  link.remove();
}

// The figure as shown, with the legend and the background of the page.
async function saveImage(figure, format) {
  const canvas = figure.querySelector(".canvas");
  const { width, height } = canvas.getBoundingClientRect();
  const named = canvas.data.filter((trace) => trace.name);
  const first = (trace) => named.findIndex((other) => other.name === trace.name) === named.indexOf(trace);
  const data = canvas.data.map((trace) => ({ ...trace, showlegend: Boolean(trace.name) && first(trace) }));
  const few = new Set(named.map((trace) => trace.name)).size;
  const layout = {
    ...canvas.layout, paper_bgcolor: inks().paper, showlegend: few > 0 && few <= 12,
    legend: { orientation: "h", y: 1.02, yanchor: "bottom", font: { size: 11 } },
    margin: { ...canvas.layout.margin, t: (canvas.layout.margin?.t ?? 14) + 18 * Math.ceil(Math.min(few, 12) / 2) },
  };
  save(await Plotly.toImage({ data, layout }, { format, width: Math.max(width, 700), height: Math.max(height, 420), scale: 2 }), fileName(figure, format));
}

// Name, x, y, and limits of each curve, if it has them.
function valuesOf(figure) {
  const canvas = figure.querySelector(".canvas");
  const title = (name, otherwise) => plainText(canvas.layout[name]?.title?.text ?? "") || otherwise;
  const rows = [];
  for (const trace of canvas.data) {
    if (!trace.name || trace.meta?.guide) continue;
    const y = trace.yaxis ? title(trace.yaxis.replace("y", "yaxis"), "y") : title("yaxis", "");
    const { ticktext: categories, tickvals: places } = canvas.layout.yaxis;
    trace.x.forEach((x, i) => {
      if (trace.x[i] === null || trace.y[i] === null || Number.isNaN(trace.y[i])) return;
      const flat = Boolean(trace.error_x) || trace.meta?.flat;
      const low = trace.meta?.low?.[i] ?? (trace.error_x?.arrayminus ? x - trace.error_x.arrayminus[i] : trace.error_y?.arrayminus ? trace.y[i] - trace.error_y.arrayminus[i] : null);
      const high = trace.meta?.high?.[i] ?? (trace.error_x?.array ? x + trace.error_x.array[i] : trace.error_y?.array ? trace.y[i] + trace.error_y.array[i] : null);
      const place = flat && categories ? plainText(categories[places.indexOf(Math.round(trace.y[i]))] ?? "") : trace.y[i];
      rows.push([trace.name, trace.meta?.of ?? y, x, place, low, high]);
    });
  }
  return { heads: ["series", "quantity", title("xaxis", "x"), title("yaxis", "value"), "lower 95 %", "upper 95 %"], rows };
}

function plainText(markup) {
  return element("template", { innerHTML: markup.replaceAll("<br>", " ") }).content.textContent.trim();
}

function saveValues(figure) {
  const { heads, rows } = valuesOf(figure);
  const quoted = (value) => (value === null || value === undefined ? "" : typeof value === "number" ? String(value) : `"${String(value).replaceAll('"', '""')}"`);
  const text = [heads, ...rows].map((row) => row.map(quoted).join(",")).join("\n");
  const address = URL.createObjectURL(new Blob([`${text}\n`], { type: "text/csv" }));
  save(address, fileName(figure, "csv"));
  window.setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

const SHOWN_VALUES = 400;

function showValues(figure, button) {
  const before = figure.querySelector(".values");
  button.setAttribute("aria-expanded", String(!before));
  if (before) return before.remove();
  const { heads, rows } = valuesOf(figure);
  const region = element("div", { className: "scroll values", tabIndex: 0 });
  region.setAttribute("role", "region");
  region.setAttribute("aria-label", `Values of ${figure.querySelector(".canvas").getAttribute("aria-label")}`);
  const used = heads.map((_, column) => rows.some((row) => row[column] !== null && row[column] !== ""));
  const cells = (row, tag) => row.filter((_, column) => used[column]).map((value) => {
    const cell = element(tag, { textContent: typeof value === "number" ? numberText(value, 4) : value ?? "–" });
    if (tag === "th") cell.scope = "col";
    else if (typeof value === "number") cell.className = "number";
    return cell;
  });
  const line = (row, tag) => element("tr", {}, ...cells(row, tag));
  const more = rows.length > SHOWN_VALUES ? `; first ${SHOWN_VALUES} of ${rows.length} (all in the CSV)` : "";
  const table = element("table", {}, element("caption", { textContent: `Values of the figure${more}` }));
  table.createTHead().append(line(heads, "th"));
  table.createTBody().append(...rows.slice(0, SHOWN_VALUES).map((row) => line(row, "td")));
  region.append(table);
  figure.append(region);
}

function drawTools(figure) {
  if (figure.querySelector(".tools")) return;
  const bar = element("div", { className: "tools" });
  const add = (text, name, act, more = {}) => {
    const button = element("button", { type: "button", textContent: text, title: name, onclick: () => act(button), ...more });
    button.setAttribute("aria-label", name);
    bar.append(button);
    return button;
  };
  const reset = () => {
    zooms.set(figure, {});
    showZoom(figure);
    drawFigure(figure);
  };
  add("Reset zoom", "Reset the zoom", reset, { className: "whole", hidden: true });
  add("Values", "Values of the figure as a table", (button) => showValues(figure, button)).setAttribute("aria-expanded", "false");
  add("CSV", "Save the values as CSV", () => saveValues(figure));
  add("PNG", "Save the figure as PNG", () => saveImage(figure, "png"));
  add("SVG", "Save the figure as SVG", () => saveImage(figure, "svg"));
  figure.querySelector("figcaption").before(bar);
}
