// The figures of sensors side by side: curves and their ratio, parameters, errors and their sources.

const SLOPES = [[-0.5, "−½", "white noise"], [0, "0", "bias instability"], [0.5, "+½", "random walk"]];

// Short lines in the corner with the slope of each kind of noise, for comparison with a curve.
function slopeGuides(xRange, yRange) {
  const length = Math.min(0.1 * (xRange[1] - xRange[0]), 0.24 * (yRange[1] - yRange[0]));
  const x = xRange[0] + 0.05 * (xRange[1] - xRange[0]);
  const y = yRange[0] + 0.12 * (yRange[1] - yRange[0]);
  const { soft } = inks();
  return {
    shapes: SLOPES.map(([slope]) => ({
      type: "line", xref: "x", yref: "y", layer: "below", x0: 10 ** x, x1: 10 ** (x + length), y0: 10 ** y, y1: 10 ** (y + slope * length),
      line: { color: soft, width: 1.2 },
    })),
    annotations: SLOPES.map(([slope, text, of]) => ({
      xref: "x", yref: "y", x: x + length, y: y + slope * length, xanchor: "left", yanchor: "middle", text: `${text} ${of}`, showarrow: false,
      font: { size: 11, color: soft },
    })),
  };
}

// The name of each curve at its end, shifted where names would overlap.
function directLabels(ends, yRange, yref = "y") {
  const step = 0.055 * (yRange[1] - yRange[0]);
  const sorted = [...ends].sort((a, b) => a.y - b.y);
  let last = -Infinity;
  return sorted.map((end) => {
    const y = Math.max(end.y, last + step);
    last = y;
    return { xref: "paper", x: 1.01, xanchor: "left", yref, y, yanchor: "middle", text: end.text, showarrow: false, font: { size: 12, color: end.colour } };
  });
}

const roomForNames = (figure) => !printing() && figure.clientWidth > 700;
const lineOf = (look) => ({ color: colourOf(look), dash: look.dash, width: 1.8 });

kinds.pair = (figure) => {
  const unit = unitOf(quantityOf(chosenChannel), "adev");
  const here = chosen.map((one) => ({ one, view: channelFor(one, chosenChannel), look: lookOfChosen(one) })).filter(({ view }) => view);
  const ranges = {
    x: logRange(here.flatMap(({ view }) => array(view.tau)), 0.05),
    y: logRange(here.flatMap(({ view }) => scaled(view.adev, unit.factor)), 0.35, 0.15),
  };
  const traces = [];
  const ends = [];
  const name = ({ one }) => one.name;
  for (const each of here) {
    const { view, look, one } = each;
    const tau = array(view.tau);
    const [y, low, high] = curvesOf(view, unit);
    traces.push(...band(tau, low, high, look, 0.16, { group: "limits" }));
    traces.push({
      type: "scatter", mode: "lines+markers", x: tau, y, name: name(each), meta: { low, high }, line: lineOf(look),
      marker: { color: colourOf(look), symbol: look.marker, size: tau.map((_, i) => (i % 8 === 4 ? 7 : 0.1)) },
      text: tau.map((t, i) => `${one.name} τ ${numberText(t, 3)} s: <b>${numberText(y[i], 3)} ${unit.sign}</b><br>95 %: ${interval(low[i], high[i])}`),
      hovertemplate: "%{text}<extra></extra>",
    });
    ends.push({ y: Math.log10(y.at(-1)), text: wrapped(one.name), colour: colourOf(look) });
    const model = view.models[view.recommended];
    if (model) traces.push(line(array(model[0]), scaled(model[1], unit.factor), { ...look, width: 1 }, { group: "model", name: `${name(each)}, model`, opacity: 0.8 }));
    for (const printed of pageData.datasheets[one.sensor][chosenChannel] ?? []) {
      const at = printed.slope !== 0 ? [1 / 3, 1, 3] : [tau.at(-1) / 10, tau.at(-1) / 3, tau.at(-1)];
      traces.push({
        group: "datasheet", type: "scatter", mode: "lines+markers", name: `${one.name} datasheet: ${printed.label}`, x: at,
        y: printedLine(printed, at, unit), line: { color: colourOf(look), width: 1.2, dash: "dot" },
        marker: { color: inks().paper, symbol: "diamond", size: [0.1, 10, 0.1], line: { color: colourOf(look), width: 1.6 } },
        hoverinfo: ["skip", "text", "skip"], text: `${one.name} datasheet: ${printed.label}`,
      });
    }
  }
  const first = here[0];
  const extent = [1];
  here.slice(1).forEach((other) => {
    if (first.one !== chosen[0]) return;
    const ratios = ratiosOfDeviations(first.view.drawn, other.view.drawn);
    const [x, low, high] = ["tau", "lower", "upper"].map((of) => ratios.map((ratio) => ratio[of]));
    const y = ratios.map(({ value, values }) => value ?? values[0] / values[1]);
    extent.push(...low, ...high);
    traces.push(...band(x, low, high, other.look, 0.22, { yaxis: "y2", group: "ratio" }));
    const label = `${chosen[0].name} / ${other.one.name}`;
    traces.push({
      group: "ratio", yaxis: "y2", type: "scatter", mode: "lines+markers", x, y, name: label, meta: { low, high, of: "ratio" },
      line: lineOf(other.look), marker: { color: colourOf(other.look), size: 6, symbol: ratios.map((ratio) => (["not significant", "not determined"].includes(ratio.verdict) ? `${(other.look.plain ?? other.look.marker)}-open` : other.look.plain ?? other.look.marker)) },
      text: ratios.map((ratio, i) => `${label} at ${numberText(x[i], 3)} s: <b>${numberText(y[i], countDigits(y[i], low[i], high[i]))}</b><br>95 %: ${ratioText(ratio)}<br>${verdictOf(ratio, chosen[0], other.one).text}`),
      hovertemplate: "%{text}<extra></extra>",
    });
  });
  const slopes = slopeGuides(ranges.x, ranges.y);
  const ratioRange = logRange(extent, 0.06);
  const { ink, soft } = inks();
  const upper = [0.36, 1];
  return {
    traces,
    groups: [
      { key: "limits", label: "95 % limits", on: true, look: { ...black(), filled: true } },
      { key: "model", label: "models", on: false, look: black() },
      { key: "datasheet", label: "datasheet", on: true, look: { ...black(), dash: "dot", marker: "diamond" }, absent: !traces.some((trace) => trace.group === "datasheet") },
      { key: "slopes", label: "slopes", on: true, look: { light: soft, dark: soft } },
    ],
    height: printing() ? 380 : 470,
    layout: {
      margin: { l: 62, r: roomForNames(figure) ? 150 : 26, t: 8, b: 46 }, hovermode: "x", hoversubplots: "axis",
      xaxis: { ...logAxis("averaging time τ (s)", ranges.x), anchor: "y2" },
      yaxis: { ...logAxis(`Allan deviation (${unit.sign})`, ranges.y), domain: upper },
      yaxis2: { ...logAxis("ratio of σ", ratioRange), domain: [0, 0.27] },
      annotations: [
        ...(roomForNames(figure) ? directLabels(ends, ranges.y) : []),
        ...(shown(figure, "slopes") ? slopes.annotations : []),
        { xref: "paper", x: 0.995, xanchor: "right", yref: "y2", y: 0, yanchor: "bottom", text: "1: equal", showarrow: false, font: { size: 11, color: soft } },
      ],
      shapes: [
        { type: "line", xref: "paper", x0: 0, x1: 1, yref: "y2", y0: 1, y1: 1, line: { color: ink, width: 1 } },
        { type: "line", xref: "x", x0: crossed, x1: crossed, yref: "paper", y0: 0, y1: 1, line: { color: soft, width: 1, dash: "dot" } },
        ...(shown(figure, "slopes") ? slopes.shapes : []),
      ],
    },
  };
};

// One crosshair through both panels: it follows the pointer, and a slider for the keyboard.
kinds.pair.started = (figure, canvas) => {
  const form = element("form", { className: "chooser crosshair" });
  form.addEventListener("submit", (event) => event.preventDefault());
  const slider = element("input", { type: "range", step: "0.1", autocomplete: "off" });
  const said = element("output");
  form.append(labelled("Crosshair at τ", slider), said);
  figure.querySelector(".controls").after(form);
  const put = (tau) => {
    const { xaxis, shapes } = canvas.layout;
    const inside = Math.min(Math.max(Math.log10(tau), xaxis.range[0]), xaxis.range[1]);
    crossed = 10 ** inside;
    [slider.min, slider.max] = [Math.ceil(10 * xaxis.range[0]) / 10, Math.floor(10 * xaxis.range[1]) / 10].map(String);
    slider.value = String(inside);
    const text = crosshairText(crossed);
    slider.setAttribute("aria-valuetext", text);
    said.textContent = text;
    if (shapes[1].x0 !== crossed) Plotly.relayout(canvas, { "shapes[1].x0": crossed, "shapes[1].x1": crossed });
  };
  slider.addEventListener("input", () => put(10 ** Number(slider.value)));
  slider.addEventListener("change", () => keep("tau", numberText(crossed, 3)));
  canvas.on("plotly_hover", ({ points }) => put(points[0].x));
  canvas.on("plotly_afterplot", () => said.textContent !== crosshairText(crossed) && put(crossed));
  put(crossed);
};

function crosshairText(tau) {
  const unit = unitOf(quantityOf(chosenChannel), "adev");
  const parts = chosen.flatMap((one) => {
    const view = channelFor(one, chosenChannel);
    if (!view) return [];
    const times = array(view.tau);
    const at = times.reduce((best, t, i) => (Math.abs(Math.log(t / tau)) < Math.abs(Math.log(times[best] / tau)) ? i : best), 0);
    if (Math.abs(Math.log10(times[at] / tau)) > 0.2) return [`${one.name} –`];
    return [`${one.name} ${numberText(scaled(view.adev, unit.factor)[at], 3)} ${unit.sign}`];
  });
  return `${numberText(tau, 2)} s: ${parts.join(", ")}`;
}

kinds.dumbbells = (figure) => {
  const figures = comparedFigures().filter((one) => one.drawn).reverse();
  const traces = [];
  const extent = [1];
  const { soft } = inks();
  const narrow = figure.clientWidth < 560;
  const words = figures.map(({ label, long, own, unit }) => narrow ? symbolMarkup(label) : `${long}<br>${own.map((one, i) => `${chosen[i].name} ${one.value === null ? "–" : estimateTexts(one.value, one.lower, one.upper, unit)[0]}`).join(", ")} ${unit.sign}`);
  figures.forEach(({ own }, place) => {
    const base = own[0].value;
    const middle = (one) => one.value ?? (one.lower > 0 && one.upper ? Math.sqrt(one.lower * one.upper) : one.upper);
    if (!base) return;
    const values = own.map((one) => (middle(one) ? middle(one) / base : null));
    const known = values.filter((value) => value !== null);
    traces.push({ type: "scatter", mode: "lines", x: [Math.min(...known), Math.max(...known)], y: [place, place], hoverinfo: "skip", line: { color: faint(soft, 0.6), width: 5 }, meta: { guide: true } });
    own.forEach((one, i) => {
      if (values[i] === null) return;
      const look = lookOfChosen(chosen[i]);
      const bounded = one.lower > 0 && one.upper !== null;
      extent.push(values[i], ...(bounded ? [one.lower / base, one.upper / base] : []));
      const surely = one.value !== null && one.status === "ok";
      traces.push({
        type: "scatter", mode: "markers", x: [values[i]], y: [place], name: chosen[i].name, meta: { flat: true },
        marker: { color: surely ? colourOf(look) : inks().paper, symbol: look.plain ?? look.marker, size: 11, line: { color: colourOf(look), width: surely && !look.plain ? 0 : 2 } },
        error_x: bounded ? { type: "data", symmetric: false, array: [one.upper / base - values[i]], arrayminus: [values[i] - one.lower / base], color: colourOf(look), thickness: 2, width: 5 } : undefined,
        hovertemplate: `${chosen[i].name}: ${numberText(values[i], 3)} times ${chosen[0].name}<extra></extra>`,
      });
    });
  });
  return {
    traces, groups: [], height: 110 + (printing() ? 30 : 52) * figures.length,
    layout: {
      margin: { l: 10, r: 20, t: 12, b: 50 },
      xaxis: logAxis(`divided by the value of ${chosen[0].name}`, logRange(extent, 0.08)),
      yaxis: { ...linearAxis(""), tickvals: words.map((_, i) => i), ticktext: words, range: [-0.6, Math.max(figures.length, 1) - 0.4], fixedrange: true },
      shapes: [{ type: "line", x0: 1, x1: 1, yref: "paper", y0: 0, y1: 1, line: { color: soft, width: 1 } }],
      annotations: figures.flatMap(({ own }, y) => (own[0].value ? [] : [{
        xref: "paper", x: 0.01, y, xanchor: "left", showarrow: false, text: `${chosen[0].name} has no value to compare with`, font: { color: soft, size: 12 }, bgcolor: inks().paper,
      }])),
    },
  };
};

// Errors of the worst axis of a recording, or of the chosen axis.
function errorsOf(one) {
  const { growth } = one.row;
  const own = growthOf.axes === "worst" ? "worst" : growth?.axes[chosenChannel.at(-1)];
  return (own === "worst" ? growth?.errors : own) ?? {};
}
const grownOf = (one) => errorsOf(one)[growthOf.error] ?? null;
const axesText = () => (growthOf.axes === "worst" ? "the worst axis" : `axis ${chosenChannel.at(-1)}`);
const place = (values, wanted) => values.reduce((best, value, i) => (Math.abs(Math.log(value / wanted)) < Math.abs(Math.log(values[best] / wanted)) ? i : best), 0);

// The nearest window and time of a recording to those that are chosen.
function chosenPlace(one) {
  const [windows, times] = [array(one.row.growth.windows), array(one.row.growth.times)];
  const [window, time] = [place(windows, growthOf.window), place(times, growthOf.time)];
  return { windows, times, window, at: window * times.length + time };
}

function startGrowth(root) {
  const form = root.querySelector("form.growth");
  form.addEventListener("submit", (event) => event.preventDefault());
  const any = pageData.recordings.find((row) => row.growth);
  form.hidden = !any;
  if (!any) return;
  const [windows, times] = [array(any.growth.windows), array(any.growth.times)];
  const stated = (key, otherwise) => Number(state.get(key)) || otherwise;
  const alone = pageData.recordings.some((row) => row.growth && Object.keys(row.growth.axes).length > 0);
  const of = ["worst", "axis"].includes(state.get("of")) ? state.get("of") : state.has("axis") ? "axis" : "worst";
  growthOf = { axes: alone ? of : "worst", error: state.get("error") in pageData.errors ? state.get("error") : "heading", window: windows[place(windows, stated("window", pageData.window))], time: times[place(times, stated("time", times.at(-1)))] };
  const select = element("select", {}, ...Object.keys(pageData.errors).map((error) => new Option(error, error)));
  select.value = growthOf.error;
  const slider = (key, values, text) => {
    const input = element("input", { type: "range", min: "0", max: String(values.length - 1), step: "1", autocomplete: "off" });
    input.value = String(place(values, growthOf[key]));
    const said = element("output");
    const show = () => {
      said.textContent = timeText(values[Number(input.value)]);
      input.setAttribute("aria-valuetext", said.textContent);
    };
    input.addEventListener("input", () => {
      growthOf[key] = values[Number(input.value)];
      show();
      keep(key, String(growthOf[key]));
      drawErrors(root);
      redrawAll();
    });
    show();
    return labelled(text, input, " ", said);
  };
  const axes = element("select", {}, new Option("worst axis", "worst"));
  if (alone) axes.append(new Option(`axis ${chosenChannel.at(-1)}: its gyro and its accelerometer`, "axis"));
  axes.value = growthOf.axes;
  for (const [control, own, key] of [[select, "error", "error"], [axes, "axes", "of"]]) {
    control.addEventListener("change", () => {
      growthOf[own] = control.value;
      keep(key, control.value);
      drawErrors(root);
      redrawAll();
    });
  }
  form.replaceChildren(labelled("Error", select), labelled("Axes", axes), slider("window", windows, "Time at rest"), slider("time", times, "Time of dead reckoning"));
}

function errorUnit(error, size) {
  const [, sign, factor] = pageData.errors[error].sized.find(([least]) => size >= least);
  return { sign, factor };
}

const timeText = (seconds) => (seconds >= 120 ? `${numberText(seconds / 60, 3)} min` : `${numberText(seconds, 3)} s`);

// The verdicts of the sensors, as on the start page: the chosen recording does not change them.
function drawRequirements(root) {
  const table = root.querySelector("table.requirements");
  if (!table) return;
  table.tHead.replaceChildren(headOf("Requirement", ...chosen.map((one) => pageData.names[one.row.sensor] ?? one.row.sensor)));
  table.tBodies[0].replaceChildren(
    ...pageData.requirements.map(({ title, sensors }) =>
      element("tr", {}, element("th", { scope: "row" }, title), ...chosen.map((one) => element("td", {}, sensors[one.row.sensor] ?? "not ranked"))),
    ),
  );
  const own = state.get("yours") ?? remembered("imubench yours");
  if (own) addOwnVerdicts(table, own);
}

// The verdicts by the requirement of the reader (`requirement.js`).
async function addOwnVerdicts(table, text) {
  const models = await loadModels();
  table.querySelector(".own")?.remove();
  if (!models?.requirements.length) return;
  const own = readRequirement(models, text);
  const judged = judgeOwn(models, own);
  const limits = own.limits.map(({ error, at_most: most, time }) => {
    const [unit, factor] = ERROR_UNITS[error];
    return `${error.replace("_", "-")} ${numberText(most / factor, 3)} ${unit} in ${numberText(time, 3)} s`;
  });
  const cells = chosen.map((one) => {
    const { verdict, margin, noise } = judged[one.row.sensor] ?? { verdict: "not_enough_data", margin: null };
    const margins = margin === null ? "" : `, margin in use ${numberText(margin, 3)}, noise-only margin ${numberText(noise, 2)}`;
    return element("td", {}, `${pageData.verdicts[verdict]}${margins}`);
  });
  table.tBodies[0].append(element("tr", { className: "own" }, element("th", { scope: "row" }, `Yours: ${limits.join(", ")}`), ...cells));
}

function drawErrors(root) {
  const table = root.querySelector("table.errors");
  const figures = [];
  if (chosen.every((one) => one.row.growth)) {
    for (const error of Object.keys(pageData.errors)) {
      const own = chosen.map((one) => {
        const grown = errorsOf(one)[error];
        if (!grown) return null;
        const { at } = chosenPlace(one);
        const [value, lower, upper] = ["sigma", "lower", "upper"].map((name) => array(grown[name])[at]);
        return { value, lower, upper, status: "ok" };
      });
      if (own.includes(null)) continue;
      figures.push({ symbol: error, label: error, unit: (size) => errorUnit(error, size), own, ratios: own.slice(1).map((other) => ratioOfParameters(own[0], other)) });
    }
  }
  table.tHead.replaceChildren(headOf(`After ${timeText(growthOf.time)}`, ...headsOfPairs(), ...chosen.map((one) => one.name)));
  table.tBodies[0].replaceChildren(...linesOf(figures));
  const without = chosen.filter((one) => !grownOf(one)).map((one) => one.name);
  table.caption.textContent = `Errors from noise alone (1σ, ${axesText()}): biases and tilt estimated over ${timeText(growthOf.window)} at rest, then ${timeText(growthOf.time)} of dead reckoning${without.length ? `; ${growthOf.error} not determined for ${without.join(", ")}` : ""}`;
}

kinds.growth = (figure) => {
  const [sign, factor] = pageData.errors[growthOf.error].axis;
  const traces = [];
  const extent = [];
  const ends = [];
  const every = [];
  for (const one of chosen) {
    const grown = grownOf(one);
    if (!grown) continue;
    const look = lookOfChosen(one);
    const { times, windows, window } = chosenPlace(one);
    const cut = (name) => scaled(grown[name], factor).slice(window * times.length, (window + 1) * times.length);
    const [y, low, high] = ["sigma", "lower", "upper"].map(cut);
    every.push(...times);
    extent.push(...low, ...high);
    traces.push(...band(times, low, high, look, 0.18, { group: "limits" }));
    const axes = [grown.gyro, grown.accel].map((channels) => channels[channels.length > 1 ? window * times.length + times.length - 1 : 0]).filter(Boolean);
    traces.push({
      type: "scatter", mode: "lines+markers", x: times, y, name: one.name, meta: { low, high }, line: lineOf(look),
      marker: { color: colourOf(look), symbol: look.marker, size: 7 },
      text: times.map((t, i) => `${one.name} after ${timeText(t)}: <b>${numberText(y[i], countDigits(y[i], low[i], high[i]))} ${sign}</b><br>95 %: ${interval(low[i], high[i])}<br>${axes.map((name) => CHANNEL_NAMES[name]).join(", ")}, ${timeText(windows[window])} at rest`),
      hovertemplate: "%{text}<extra></extra>",
    });
    ends.push({ y: Math.log10(y.at(-1)), text: wrapped(one.name), colour: colourOf(look) });
  }
  const { soft } = inks();
  const range = logRange(extent, 0.15);
  return {
    traces,
    groups: [
      { key: "limits", label: "95 % band", on: true, look: { ...black(), filled: true } },
    ],
    layout: {
      margin: { l: 62, r: roomForNames(figure) ? 150 : 26, t: 8, b: 46 },
      xaxis: logAxis("time of dead reckoning (s)", logRange(every, 0.08)), yaxis: logAxis(`${growthOf.error}, 1σ (${sign})`, range),
      annotations: roomForNames(figure) ? directLabels(ends, range) : [],
      shapes: [{ type: "line", xref: "x", x0: growthOf.time, x1: growthOf.time, yref: "paper", y0: 0, y1: 1, line: { color: soft, width: 1, dash: "dot" } }],
    },
  };
};

kinds.sources = (figure) => {
  const here = chosen.filter(grownOf).reverse();
  const shares = here.map((one) => Object.entries(grownOf(one).sources).map(([source, of]) => [source, array(of.shares)[chosenPlace(one).at], of.kind]));
  return stackedShares(
    here.map((one) => {
      const ends = ["sigma", "lower", "upper"].map((name) => array(grownOf(one)[name])[chosenPlace(one).at]);
      const unit = errorUnit(growthOf.error, ends[0]);
      return `${wrapped(one.name)}<br>${estimateTexts(...ends, unit)[0]} ${unit.sign}`;
    }),
    shares, here.map((one) => one.name), figure.clientWidth,
  );
};

// Bars of shares of a variance: [source, share, kind]. Shares below 2 % are merged. Sources of two
// sensors are merged by kind, without the correlation time, which differs by log.
function stackedShares(rows, shares, titles, width) {
  const inner = Math.max(width - 190, 100); // px of a whole bar, about
  const total = new Map();
  const large = shares.map((parts) => {
    const kept = parts.filter(([, share]) => share >= 0.02);
    const rest = 1 - kept.reduce((sum, [, share]) => sum + share, 0);
    return rest > 0.005 ? [...kept, ["others", rest, "others"]] : kept;
  });
  large.flat().forEach(([, share, kind]) => total.set(kind, Math.max(total.get(kind) ?? 0, share)));
  const order = [...total].sort(([a, x], [b, y]) => (a === "others") - (b === "others") || y - x).map(([source]) => source);
  const looks = order.map((source, number) => (source === "others" ? { light: "#8a9299", dark: "#6b7680" } : TERM_COLOURS[number % TERM_COLOURS.length]));
  const traces = order.map((source, number) => {
    const own = large.map((parts) => parts.filter(([, , kind]) => kind === source));
    const sums = own.map((parts) => parts.reduce((sum, [, share]) => sum + share, 0));
    return {
      group: `source ${source}`, type: "bar", orientation: "h", name: source, x: sums.map((share) => 100 * share), y: rows.map((_, i) => i), meta: { flat: true },
      marker: { color: faint(colourOf(looks[number]), 0.55), line: { color: inks().paper, width: 1 }, pattern: { fillmode: "overlay", shape: ["", "/", ".", "x", "-", "\\"][number % 6], fgcolor: inks().paper, size: 7 } },
      text: sums.map((share) => {
        const percent = `${numberText(100 * share, 2)} %`;
        return [`${source} ${percent}`, percent].find((words) => 7 * words.length < share * inner) ?? "";
      }), textposition: "inside", insidetextanchor: "middle",
      insidetextfont: { color: inks().ink, size: printing() ? 9 : 12 }, constraintext: "none", textangle: 0,
      hovertext: own.map((parts, i) => `${titles[i]}<br>${parts.map(([name, share]) => `${name}: ${numberText(100 * share, 2)} %`).join("<br>")}`), hovertemplate: "%{hovertext}<extra></extra>",
    };
  });
  return {
    traces,
    groups: order.map((source, number) => ({ key: `source ${source}`, label: source, on: true, look: { ...looks[number], filled: true } })),
    height: 90 + (rows.length > 6 ? (printing() ? 15 : 26) : 64) * Math.max(rows.length, 1),
    layout: {
      barmode: "stack", bargap: 0.3, margin: { l: 10, r: 14, t: 8, b: 46 },
      xaxis: { ...linearAxis("% of the variance"), range: [0, 100] },
      yaxis: { ...linearAxis(""), tickvals: rows.map((_, i) => i), ticktext: rows, range: [-0.6, rows.length - 0.4], fixedrange: true },
    },
  };
}
