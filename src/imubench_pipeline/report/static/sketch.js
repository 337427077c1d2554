// A preview of a figure as SVG, because loading plotly.js takes a second. The figure replaces it.

const svg = (name, attributes, ...inside) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) if (value !== undefined && value !== "") made.setAttribute(key, value);
  made.append(...inside);
  return made;
};

// Draws the first figure of a page, and those in view.
function sketchFigures(figures) {
  const seen = (figure) => figure.getBoundingClientRect().top < window.innerHeight && figure.clientWidth > 0;
  figures.filter((figure, place) => figure.clientWidth > 0 && (place === 0 || seen(figure))).forEach(sketchFigure);
}

function sketchFigure(figure) {
  const made = kinds[figure.dataset.kind](figure);
  const on = openingChoices(figure, made.groups);
  const layout = { ...baseLayout(), ...made.layout };
  const named = axesOf(layout).some((name) => layout[name].type !== "log" && layout[name].ticktext);
  if (named || made.traces.some((trace) => trace.orientation === "h")) return; // the left margin depends on the names of the rows
  zoomIn(figure, layout);
  const canvas = figure.querySelector(".canvas");
  const paper = printing() ? onPaper(figure) : {};
  const height = made.height ?? paper.height;
  if (height) canvas.style.height = `${height}px`;
  const traces = made.traces.filter((trace) => isOn(trace, (group) => on.get(group) ?? true));
  choices.set(figure, on);
  dress(figure, layout, { ...made, traces }, [paper.width ?? canvas.clientWidth, canvas.clientHeight]);
  choices.delete(figure);
  const drawing = new Sketch(paper.width ?? canvas.clientWidth, canvas.clientHeight, layout, traces);
  canvas.replaceChildren(drawing.svg);
  figure.dataset.sketched = "yes";
}

class Sketch {
  constructor(width, height, layout, traces) {
    const { l, r, t, b } = layout.margin;
    this.box = { left: l, top: t, width: width - l - r, height: height - t - b };
    this.svg = svg("svg", { class: "sketch", width, height, "aria-hidden": "true" });
    this.axes = Object.fromEntries(axesOf(layout).map((name) => [name, this.axis(name, layout[name], traces)]));
    for (const [name, axis] of Object.entries(this.axes)) this.ticks(name, axis);
    const { left, top, width: wide, height: high } = this.box;
    this.inside = svg("svg", { x: left, y: top, width: wide, height: high, viewBox: [left, top, wide, high].join(" ") });
    this.svg.append(this.inside);
    for (const shape of layout.shapes ?? []) this.shape(shape);
    let before = null;
    for (const trace of traces) before = this.trace(trace, before);
    for (const note of layout.annotations ?? []) this.note(note);
  }

  axis(name, axis, traces) {
    const log = axis.type === "log";
    const values = traces.filter((trace) => (trace[`${name[0]}axis`] ?? name[0]).replace(/^[xy]/, "$&axis") === name).flatMap((trace) => [...trace[name[0]]]);
    let [low, high] = axis.range ?? [Infinity, -Infinity];
    if (!axis.range) {
      for (const value of values) if (value !== null && Number.isFinite(value)) [low, high] = [Math.min(low, value), Math.max(high, value)];
      const room = name[0] === "y" ? 0.05 * (high - low) : 0;
      [low, high] = [axis.rangemode === "tozero" ? 0 : low - room, high + room];
    }
    const [from, to] = axis.domain ?? [0, 1];
    const { left, top, width, height } = this.box;
    const share = (value) => from + (to - from) * (((log ? Math.log10(value) : value) - low) / (high - low || 1));
    const place = name[0] === "x" ? (value) => left + width * share(value) : (value) => top + height * (1 - share(value));
    return { ...axis, log, low, high, from, to, place };
  }

  ticks(name, axis) {
    const { left, top, width, height } = this.box;
    const { soft, grid } = inks();
    let [values, texts] = [axis.tickvals ?? [], axis.ticktext ?? []];
    if (!axis.log) {
      const step = [1, 2, 5, 10].map((each) => each * 10 ** Math.floor(Math.log10((axis.high - axis.low) / 5 || 1))).find((each) => (axis.high - axis.low) / each <= 6);
      values = Array.from({ length: 8 }, (_, i) => (Math.ceil(axis.low / step) + i) * step).filter((value) => value <= axis.high);
      texts = values.map((value) => tickText(Number(value.toPrecision(6))));
    }
    const bottom = top + height * (1 - axis.from);
    values.forEach((value, i) => {
      const at = axis.place(value);
      const across = name[0] === "x" ? { x1: at, x2: at, y1: top, y2: top + height } : { x1: left, x2: left + width, y1: at, y2: at };
      const text = name[0] === "x" ? { x: at, y: top + height + 17, "text-anchor": "middle" } : { x: left - 5, y: at + 4, "text-anchor": "end" };
      this.svg.append(svg("line", { ...across, stroke: grid }), svg("text", { ...text, fill: axis.color ?? soft, "font-size": 13 }, texts[i]));
    });
    const title = plainText(axis.title?.text ?? "");
    const middle = (bottom + top + height * (1 - axis.to)) / 2;
    const of = name[0] === "x" ? { x: left + width / 2, y: top + height + 38 } : { x: 13, y: middle, transform: `rotate(-90 13 ${middle})` };
    this.svg.append(svg("text", { ...of, fill: axis.color ?? soft, "font-size": 14, "text-anchor": "middle" }, title));
  }

  trace(trace, before) {
    const [x, y] = ["x", "y"].map((of) => this.axes[(trace[`${of}axis`] ?? of).replace(/^[xy]/, "$&axis")]);
    const points = Array.from(trace.x, (value, i) => (value === null || trace.y[i] === null ? [NaN, NaN] : [x.place(value), y.place(trace.y[i])]));
    if (trace.type === "bar") {
      const zero = y.place(y.log ? 10 ** y.low : 0);
      points.forEach(([at, high], i) => {
        const wide = Math.abs(x.place(trace.x[i] + (trace.width?.[i] ?? 1) / 2) - at) * 2;
        if (Number.isFinite(at + high)) this.inside.append(svg("rect", { x: at - wide / 2, y: Math.min(high, zero), width: wide, height: Math.abs(zero - high), fill: trace.marker.color }));
      });
      return points;
    }
    if (trace.fill === "tonexty" && before) this.area([...before, ...[...points].reverse()], trace.fillcolor);
    if (trace.fill === "toself") this.area(points, trace.fillcolor);
    if (trace.mode.includes("lines") && trace.line?.width !== 0) {
      this.inside.append(svg("path", {
        d: pathOf(points), fill: "none", stroke: trace.line?.color, "stroke-width": trace.line?.width ?? 2, "stroke-dasharray": DASHES[trace.line?.dash] ?? "", opacity: trace.opacity,
      }));
    }
    if (trace.mode.includes("markers")) {
      points.forEach(([cx, cy], i) => {
        const of = (value) => (Array.isArray(value) ? value[i] : value);
        const [size, colour, symbol] = [of(trace.marker.size) ?? 6, of(trace.marker.color), String(of(trace.marker.symbol) ?? "")];
        if (size < 1 || !Number.isFinite(cx + cy)) return;
        const edge = of(trace.marker.line?.color) ?? colour;
        this.inside.append(svg("circle", { cx, cy, r: size / 2, fill: /open|thin/.test(symbol) ? "none" : colour, stroke: edge }));
      });
    }
    return points;
  }

  area(points, fill) {
    const known = points.filter(([x, y]) => Number.isFinite(x + y)).length;
    if (known === 0) return;
    const path = pathOf(points);
    this.inside.append(svg("path", { d: known === points.length ? `${path}Z` : path.replaceAll("M", "ZM").replace("Z", ""), fill }));
  }

  // On a logarithmic axis, shapes have values and annotations have logarithms.
  at(of, reference, value, logarithm = false) {
    const { left, top, width, height } = this.box;
    if (reference === "paper") return of === "x" ? left + width * value : top + height * (1 - value);
    const axis = this.axes[(reference ?? of).replace(/^[xy]/, "$&axis")];
    return axis.place(logarithm && axis.log ? 10 ** value : value);
  }

  shape({ type, xref, yref, x0, x1, y0, y1, line: edge = {}, fillcolor }) {
    const [left, right] = [x0, x1].map((value) => this.at("x", xref, value));
    const [low, high] = [y0, y1].map((value) => this.at("y", yref, value));
    if (![left, right, low, high].every(Number.isFinite)) return;
    const look = { stroke: edge.color, "stroke-width": edge.width ?? 1, "stroke-dasharray": DASHES[edge.dash] ?? "" };
    this.inside.append(type === "line"
      ? svg("line", { x1: left, x2: right, y1: low, y2: high, ...look })
      : svg("rect", { x: Math.min(left, right), y: Math.min(low, high), width: Math.abs(right - left), height: Math.abs(high - low), fill: fillcolor ?? "none", ...look }));
  }

  note({ x, y, xref, yref, xanchor, yanchor, text, font = {}, ax = 0, ay = 0, xshift = 0 }) {
    const [from, to] = [this.at("x", xref, x, true) + xshift, this.at("y", yref, y, true)];
    if (!Number.isFinite(from + to)) return;
    if (ax || ay) this.svg.append(svg("line", { x1: from, y1: to, x2: from + 0.7 * ax, y2: to + 0.7 * ay, stroke: font.color, opacity: 0.5 }));
    const [left, level] = [from + ax, to + ay];
    const size = font.size ?? 12;
    const anchor = { left: "start", right: "end" }[xanchor] ?? "middle";
    const down = { top: size, bottom: -3 }[yanchor] ?? size / 3;
    this.svg.append(svg("text", { x: left, y: level + down, "text-anchor": anchor, "font-size": size, fill: font.color ?? inks().ink }, plainText(text)));
  }
}

// Lines between consecutive known points.
function pathOf(points) {
  let open = false;
  return points.map(([x, y]) => {
    const known = Number.isFinite(x + y);
    const text = known ? `${open ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}` : "";
    open = known;
    return text;
  }).join("");
}
