// The figures of one channel: curve, spectrum, samples over time, histogram.

const black = () => ({ light: inks().ink, dark: inks().ink });
const TERM_DASHES = ["dash", "dot", "dashdot", "longdash"];
const termLook = (place) => ({ ...TERM_COLOURS[place % TERM_COLOURS.length], dash: TERM_DASHES[place % TERM_DASHES.length], width: 1.4 });
const MARKED = { light: "#B3001B", dark: "#FF8F8F" };

// Samples and curves have the colour of the sensor on every page; the recommended model is black.
function sensorLook(sensor) {
  const looks = pageData.looks?.sensors ?? {};
  return looks[sensor] ?? Object.values(looks)[0] ?? { light: "#0072B2", dark: "#4DA3D9", dash: "solid", marker: "circle" };
}

function channelOf(figure) {
  // A sensor may be on several boards, which one page shows.
  const { channel, sensor, recording } = figure.dataset;
  return pageData.channels.find((entry) => (
    entry.channel === channel && entry.sensor === (sensor ?? entry.sensor) && entry.recording === (recording ?? entry.recording)
  ));
}

const printedOf = (view) => view.datasheet ?? pageData.datasheets[view.sensor][view.channel];

// The axes of the gyroscope or of the accelerometer in one figure.
kinds.axes = (figure) => {
  const { quantity, recording } = figure.dataset;
  const views = pageData.channels.filter((view) => quantityOf(view.channel) === quantity && view.recording === (recording ?? view.recording));
  const unit = unitOf(figure.dataset.quantity, "adev");
  const ranges = { x: logRange(views.flatMap((view) => array(view.tau)), 0.1), y: logRange(views.flatMap((view) => scaled(view.adev, unit.factor)), 0.5, 0.3) };
  const { soft } = inks();
  const plain = { light: soft, dark: soft };
  const grades = gradeBands(figure.dataset.quantity, unit, ranges);
  const marks = noiseMarks(views, ranges);
  const curves = views.map((view) => {
    const look = AXIS_LOOKS[view.channel.split("_")[1]] ?? sensorLook(view.sensor);
    const colour = colourOf(look);
    // The page of a sensor has only the curves of the models.
    const of = view.methods?.[view.recommended];
    const best = of ? [of.tau, of.model] : view.models?.[view.recommended];
    return {
      look, key: view.channel,
      under: limitsOf(view, unit, look, 0.16, [view.channel, "limits"]),
      over: [
        curveOf(view, unit, view.channel.replace("_", " "), { group: view.channel, mode: "markers", marker: { color: colour, symbol: look.marker, size: 5 } }),
        ...(best ? [line(array(best[0]), scaled(best[1], unit.factor), { ...look, width: 2 }, { group: [view.channel, "model"], name: `${view.channel.replace("_", " ")}, model` })] : []),
        ...printedOf(view).filter(({ label }) => views.find((other) => printedOf(other).some((one) => one.label === label)) === view).map((printed) => line(array(view.tau), printedLine(printed, array(view.tau), unit), { ...MARKED, dash: "dot", width: 1.4 }, {
          group: [view.channel, "datasheet"], hoverinfo: "name", name: `datasheet: ${printed.label}`, meta: { guide: true },
        })),
      ],
    };
  });
  return {
    traces: [...grades.traces, ...curves.flatMap(({ under }) => under), ...marks.traces, ...curves.flatMap(({ over }) => over)],
    labels: [...grades.labels.map((label) => ({ ...label, group: "grades" })), ...marks.labels.map((label) => ({ ...label, group: "marks" }))],
    groups: [
      ...curves.map(({ key, look }) => ({ key, label: key.replace("_", " "), on: true, look })),
      { key: "grades", label: "grades", on: true, look: { ...plain, filled: true }, more: true },
      { key: "marks", label: "N, B and K", on: true, look: { ...plain, dash: "dash" }, more: true },
      { key: "model", label: "fitted model", on: true, look: plain, more: true },
      { key: "limits", label: "95 % limits", on: true, look: { ...plain, filled: true }, more: true },
      { key: "datasheet", label: "datasheet", on: true, look: { ...MARKED, dash: "dot" }, more: true, absent: views.every((view) => printedOf(view).length === 0) },
    ],
    layout: {
      margin: { l: 60, r: GRADE_MARGIN, t: 14, b: 50 },
      xaxis: logAxis("averaging time τ (s)", ranges.x), yaxis: logAxis(`Allan deviation (${unit.sign})`, ranges.y),
    },
  };
};

kinds.allan = (figure) => {
  const view = channelOf(figure);
  const unit = unitOf(quantityOf(view.channel), "adev");
  const tau = array(view.tau);
  const y = scaled(view.adev, unit.factor);
  const what = view.simulated ? "simulated log" : "measured";
  const best = view.methods[view.recommended];
  const own = { ...sensorLook(view.sensor), dash: "solid" };
  const look = { ...pageData.looks.methods, [view.recommended]: { ...pageData.looks.methods[view.recommended], ...black() } };
  const traces = limitsOf(view, unit, own, 0.22, "limits");
  const groups = [
    { key: "measured", label: what, on: true, look: own },
    { key: "limits", label: "95 % limits", on: true, look: { ...own, marker: undefined, filled: true } },
  ];
  if (best) {
    const times = array(best.tau);
    traces.push(...band(times, scaled(best.lower, unit.factor), scaled(best.upper, unit.factor), look[view.recommended], 0.12, { group: "band" }), {
      group: "reconstructed", type: "scatter", mode: "markers", x: times, y: scaled(best.reconstructed, unit.factor), hoverinfo: "skip",
      marker: { color: colourOf(look[view.recommended]), symbol: "x-thin-open", size: 6 },
    });
  }
  traces.push(curveOf(view, unit, what, {
    group: "measured", line: { color: colourOf(own), width: 1.4 }, marker: { color: colourOf(own), symbol: own.marker, size: 5 },
  }));
  if ("tau" in view.compensated) {
    const without = look.compensated;
    const colour = colourOf(without);
    traces.push(curveOf(view.compensated, unit, "temperature compensated", { group: "compensated", line: { color: colour, width: 1.2 }, marker: { size: 4, color: colour } }));
    groups.push({ key: "compensated", label: `${what}, temperature compensated`, on: true, look: without });
  }
  for (const [method, curve] of Object.entries(view.methods)) {
    const key = `method ${method}`;
    const use = method === view.recommended;
    traces.push(line(array(curve.tau), scaled(curve.model, unit.factor), { ...look[method], width: use ? 2.4 : 1.3 }, {
      group: key, hoverinfo: "name", name: look[method].name,
    }));
    const on = use || (figure.dataset.methods ?? "").split(" ").includes(method);
    groups.push({ key, label: look[method].name + (use ? " (recommended)" : ""), on, look: { ...look[method], marker: undefined } });
  }
  view.terms.forEach((term, place) => {
    traces.push(line(tau, scaled(term.adev, unit.factor), termLook(place), { group: `term ${place}`, hoverinfo: "name", name: term.name }));
    groups.push({ key: `term ${place}`, label: term.name, on: false, look: termLook(place) });
  });
  if (best) {
    groups.push(
      { key: "band", label: "95 % band of reconstructions", on: true, look: { ...look[view.recommended], filled: true, marker: undefined } },
      { key: "reconstructed", label: "a log simulated from the model", on: false, look: { ...look[view.recommended], line: false, marker: "x" } },
    );
  }
  view.datasheet.forEach((printed, place) => {
    const sheet = { ...MARKED, dash: TERM_DASHES[place % 4], width: 1.6 };
    traces.push(line(tau, printedLine(printed, tau, unit), sheet, {
      group: `datasheet ${place}`, hoverinfo: "name", name: `datasheet: ${printed.label}`,
    }));
    groups.push({ key: `datasheet ${place}`, label: `datasheet: ${printed.label}`, on: true, look: sheet });
  });
  const ranges = { x: logRange(tau, 0.1), y: logRange(y, 0.7, 0.25) };
  const axes = { xaxis: logAxis("averaging time τ (s)", ranges.x), yaxis: logAxis(`Allan deviation (${unit.sign})`, ranges.y) };
  return { traces, groups, layout: axes };
};

kinds.spectrum = (figure) => {
  const view = channelOf(figure);
  const spectrum = view.spectrum;
  const unit = unitOf(quantityOf(view.channel), "psd");
  const f = array(spectrum.frequency);
  const density = scaled(spectrum.density, unit.factor);
  const left = new Set(spectrum.left);
  const look = black();
  const own = sensorLook(view.sensor);
  const points = (keep, key, colour, symbol) => {
    const chosen = f.map((_, i) => i).filter((i) => left.has(i) !== keep);
    return {
      group: key, type: "scatter", mode: "markers", name: keep ? "bins used" : "bins excluded", x: chosen.map((i) => f[i]), y: chosen.map((i) => density[i]),
      marker: { color: colour, size: keep ? 4 : 5, symbol },
      text: chosen.map((i) => `${numberText(f[i], 4)} Hz: ${numberText(density[i], 3)} ${unit.sign}`),
      hovertemplate: "%{text}<extra></extra>",
    };
  };
  const traces = [points(false, "left", inks().soft, "x-thin-open"), points(true, "used", colourOf(own), own.marker)];
  const groups = [
    { key: "used", label: "bins used", on: true, look: { ...own, line: false } },
    { key: "left", label: "bins excluded", on: true, look: { light: inks().soft, dark: inks().soft, line: false, marker: "x" }, absent: left.size === 0, more: true },
  ];
  const [least, most] = ["lower", "upper"].map((of) => scaled(spectrum[of], unit.factor));
  traces.unshift(...band(array(spectrum.fit_frequency), least, most, look, 0.2, { group: "scatter" }));
  traces.push(line(array(spectrum.fit_frequency), scaled(spectrum.fitted, unit.factor), { ...look, width: 2.2 }, { group: "fit", name: `fit ${spectrum.model}`, meta: { low: least, high: most } }));
  groups.push({ key: "fit", label: `fit ${spectrum.model}`, on: true, look: { ...look, marker: undefined } });
  groups.push({ key: "scatter", label: "95 % band of the bins if the model is right", on: true, look: { ...look, marker: undefined, filled: true }, more: true });
  spectrum.terms.forEach((term, place) => {
    traces.push(line(array(spectrum.smooth), scaled(term.density, unit.factor), termLook(place), { group: `term ${place}`, hoverinfo: "name", name: term.name }));
    groups.push({ key: `term ${place}`, label: term.name, on: false, look: termLook(place), more: true });
  });
  const range = logRange(density, 0.3);
  const labels = [...spectrum.lines].sort((a, b) => b.amplitude - a.amplitude).slice(0, 6).map((each) => ({
    x: each.frequency, y: 10 ** (range[1] - 0.05 * (range[1] - range[0])), text: `${numberText(each.frequency, 3)} Hz`, colour: colourOf(MARKED), group: "lines",
  }));
  if (spectrum.lines.length > 0) {
    const own = { ...MARKED, dash: "dot", width: 1.2 };
    for (const each of spectrum.lines) {
      traces.push(line([each.frequency, each.frequency], range.map((power) => 10 ** power), own, {
        group: "lines", hoverinfo: "text", text: `${each.kind}, ${numberText(each.frequency, 5)} Hz`,
      }));
    }
    groups.push({ key: "lines", label: spectrum.lines.length === 1 ? "line" : "lines", on: true, look: own });
  }
  const layout = { xaxis: logAxis("frequency f (Hz)", logRange(f, 0.1)), yaxis: logAxis(`√PSD, two-sided (${unit.sign})`, range) };
  return { traces, groups, labels, layout };
};

function timeScale(longest) {
  for (const [size, name] of [[86400, "days"], [3600, "h"], [60, "min"]]) if (longest >= 2 * size) return { size, name };
  return { size: 1, name: "s" };
}

const middles = (of, size) => array(of.mean).map((_, i, every) => (of.start + ((i + 0.5) * (of.end - of.start)) / every.length) / size);
const meanOf = (values) => values.filter(Number.isFinite).reduce((sum, each, _, all) => sum + each / all.length, 0);
const WARM = { light: "#D55E00", dark: "#F08A3C", dash: "solid" };

// The whole log: smallest and largest samples, temperature, and the findings with their times.
kinds.timeline = (figure) => {
  const { temperature, ...envelopes } = pageData.samples.envelope;
  const names = Object.keys(envelopes);
  const scale = timeScale(envelopes[names[0]].end);
  const [traces, groups] = [[], []];
  const layout = { xaxis: linearAxis(`time (${scale.name})`), margin: { l: 60, r: 14, t: 24, b: 50 } };
  const panels = [...new Set(names.map(quantityOf)), ...(temperature ? ["temperature"] : [])];
  panels.forEach((panel, place) => {
    const yaxis = place === 0 ? "y" : `y${place + 1}`;
    const unit = panel === "temperature" ? { sign: "°C" } : unitOf(panel, "signal");
    const top = 1 - place / panels.length;
    layout[yaxis.replace("y", "yaxis")] = { ...linearAxis(panel === "temperature" ? unit.sign : `${panel} (${unit.sign})`), nticks: 4, domain: [top - 1 / panels.length + (place === panels.length - 1 ? 0 : 0.05), top] };
    if (panel === "temperature") return traces.push({ ...line(middles(temperature, scale.size), array(temperature.mean), WARM), name: "temperature", meta: { of: "°C" }, yaxis, hoverinfo: "x+y" });
    for (const name of names.filter((each) => quantityOf(each) === panel)) {
      const [low, high, mean] = ["low", "high", "mean"].map((of) => scaled(envelopes[name][of], unit.factor));
      const whole = meanOf(mean);
      const [x, look, text] = [middles(envelopes[name], scale.size), AXIS_LOOKS[name.split("_")[1]] ?? sensorLook(), name.replace("_", " ")];
      const less = (values) => values.map((each) => each - whole);
      traces.push(...band(x, less(low), less(high), look, 0.3, { group: name, yaxis }), {
        ...line(x, less(mean), { ...look, width: 1 }), group: name, name: text, yaxis, meta: { low: less(low), high: less(high) }, hoverinfo: "text",
        text: x.map((t, i) => `${text}, ${numberText(t, 4)} ${scale.name}<br>${interval(low[i], high[i])} ${unit.sign}`),
      });
      groups.push({ key: name, label: text, on: true, look: { ...look, marker: undefined } });
    }
  });
  layout.xaxis.anchor = panels.length > 1 ? `y${panels.length}` : "y";
  const events = pageData.findings.filter(({ spans }) => spans.length > 0);
  const { mark } = inks();
  layout.shapes = events.flatMap(({ finding, spans }) => (finding === "knocks" ? [[Math.min(...spans.flat()), Math.max(...spans.flat())]] : spans).map(([start, end]) => ({
    type: "rect", xref: "x", yref: "paper", y0: 0, y1: 1, x0: start / scale.size, x1: end / scale.size, fillcolor: faint(mark, 0.12), line: { color: mark, width: 1, dash: "dot" }, layer: "below",
  })));
  // A number beside an earlier one would cover it; the list of events has all.
  const near = (16 / Math.max(figure.clientWidth - 80, 200)) * (envelopes[names[0]].end / scale.size);
  const placed = [];
  for (const { number, spans } of events) {
    const x = spans[0][0] / scale.size;
    if (placed.some((other) => Math.abs(other.x - x) < near)) continue;
    placed.push({ x, xref: "x", yref: "paper", y: 1, yanchor: "bottom", xanchor: "center", text: `${number}`, showarrow: false, captureevents: true, font: { color: mark, size: 12 } });
  }
  return { traces, groups, height: 80 + 110 * panels.length, layout: { ...layout, annotations: placed } };
};

// Buttons for the events of the log: each zooms to its time and shows its text.
kinds.timeline.started = (figure, canvas) => {
  const events = pageData.findings.filter(({ spans }) => spans.length > 0);
  if (events.length === 0) return;
  const said = element("p", { className: "event" });
  said.setAttribute("role", "status");
  const show = (event) => {
    const { size } = timeScale(Object.values(pageData.samples.envelope)[0].end);
    const ends = event ? [Math.min(...event.spans.flat()), Math.max(...event.spans.flat())] : null;
    const room = ends && Math.max(ends[1] - ends[0], 0.02 * Object.values(pageData.samples.envelope)[0].end);
    zooms.set(figure, event ? { xaxis: { range: [(ends[0] - room) / size, (ends[1] + room) / size], title: canvas.layout.xaxis.title.text } } : {});
    said.textContent = event ? `${event.number}. ${event.channel ? `${event.channel}: ` : ""}${event.detail}` : "";
    bar.querySelectorAll("button").forEach((button) => button.setAttribute("aria-pressed", String(button.value === String(event?.number ?? "all"))));
    drawFigure(figure);
  };
  const button = (value, text, event) => element("button", { type: "button", value, textContent: text, onclick: () => show(event) });
  const bar = element("div", { className: "events on-screen" }, button("all", "all", null), ...events.map((event) => button(`${event.number}`, `${event.number} ${event.finding.replaceAll("_", " ")}`, event)));
  canvas.on("plotly_clickannotation", ({ annotation }) => show(events.find(({ number }) => `${number}` === annotation.text)));
  canvas.before(bar, said);
};

// The mean of the samples of a channel over time or against temperature.
kinds.bias = (figure) => {
  const { channel, over } = figure.dataset;
  const { [channel]: own, temperature } = pageData.samples.envelope;
  const unit = unitOf(quantityOf(channel), "signal");
  const scale = timeScale(own.end);
  const y = scaled(own.mean, unit.factor);
  const look = { ...sensorLook(pageData.channels[0]?.sensor), marker: undefined, dash: "solid" };
  const yaxis = linearAxis(`${channel.replace("_", " ")} (${unit.sign})`);
  if (over === "time") {
    return { traces: [{ ...line(middles(own, scale.size), y, { ...look, width: 1.4 }), name: "mean", hoverinfo: "x+y" }], groups: [], layout: { xaxis: linearAxis(`time (${scale.name})`), yaxis } };
  }
  const warm = array(temperature.mean);
  const x = y.map((_, i) => {
    const time = own.start + ((i + 0.5) * (own.end - own.start)) / y.length;
    return warm[Math.min(warm.length - 1, Math.max(0, Math.floor(((time - temperature.start) / (temperature.end - temperature.start)) * warm.length)))];
  });
  return { traces: [{ type: "scatter", mode: "markers", x, y, name: "mean", hoverinfo: "x+y", marker: { color: colourOf(look), size: 4 } }], groups: [], layout: { xaxis: linearAxis("temperature (°C)"), yaxis } };
};

kinds.compared = (figure) => {
  const channel = figure.dataset.channel;
  const drawn = pageData.of_models[channel];
  const unit = unitOf(quantityOf(channel), "signal");
  const overTime = figure.dataset.over === "envelope";
  const looks = {
    log: { ...sensorLook(pageData.channels[0]?.sensor), marker: undefined, dash: "solid" },
    before: { light: inks().soft, dark: inks().soft, dash: "dot" },
    after: { ...black(), dash: "dash" },
  };
  const named = Object.keys(looks).filter((of) => drawn[of]);
  const end = drawn.log[overTime ? "end" : "stretch_end"];
  const scale = timeScale(end);
  const traces = [];
  for (const of of named) {
    const look = looks[of];
    const mean = scaled(overTime ? drawn[of].mean : drawn[of].stretch, unit.factor);
    const x = mean.map((_, i) => ((i + 0.5) * end) / mean.length / scale.size);
    if (overTime) {
      traces.push(...band(x, scaled(drawn[of].low, unit.factor), scaled(drawn[of].high, unit.factor), look, 0.18, { group: of }));
    }
    traces.push({
      ...line(x, mean, { ...look, width: 1 }), group: of, name: drawn[of].name, hoverinfo: "text",
      text: x.map((t, i) => `${drawn[of].name}<br>${numberText(t, 4)} ${scale.name}: ${numberText(mean[i], 4)} ${unit.sign}`),
    });
  }
  return {
    traces,
    groups: named.map((of) => ({ key: of, label: drawn[of].name, on: true, look: looks[of] })),
    layout: { xaxis: linearAxis(`time (${scale.name})`), yaxis: linearAxis(`${channel.replace("_", " ")} (${unit.sign})`) },
  };
};

kinds.histogram = (figure) => {
  const channel = figure.dataset.channel;
  const histogram = pageData.samples.histogram[channel];
  const unit = unitOf(quantityOf(channel), "signal");
  const edges = scaled(histogram.edges, unit.factor);
  const [lower, upper] = [edges.slice(0, -1), edges.slice(1)];
  const count = array(histogram.count).map((each) => Math.round(each || 0));
  const total = count.reduce((sum, each) => sum + each, 0);
  const height = count.map((each, i) => each / total / (upper[i] - lower[i] || 1));
  const middle = lower.map((low, i) => (low + upper[i]) / 2);
  const mean = middle.reduce((sum, each, i) => sum + each * count[i], 0) / total;
  const deviation = Math.sqrt(middle.reduce((sum, each, i) => sum + (each - mean) ** 2 * count[i], 0) / total);
  const look = { ...sensorLook(pageData.channels[0]?.sensor), marker: undefined };
  const traces = [{
    group: "samples", type: "bar", name: "samples", x: middle, y: height, width: lower.map((low, i) => upper[i] - low),
    marker: { color: faint(colourOf(look), 0.6), line: { width: 0 } },
    text: count.map((each, i) => `${numberText(each, 3)} samples, ${interval(lower[i], upper[i])} ${unit.sign}`), textposition: "none",
    hovertemplate: "%{text}<extra></extra>",
  }];
  if (deviation > 0) {
    const x = Array.from({ length: 121 }, (_, i) => mean + (i / 20 - 3) * 1.5 * deviation);
    const y = x.map((each) => Math.exp(-(((each - mean) / deviation) ** 2) / 2) / (deviation * Math.sqrt(2 * Math.PI)));
    traces.push(line(x, y, black(), { group: "normal" }));
  }
  return {
    traces,
    groups: [
      { key: "samples", label: "samples", on: true, look: { ...look, filled: true } },
      { key: "normal", label: "normal distribution of the same spread", on: true, look: black(), absent: !(deviation > 0) },
    ],
    layout: { xaxis: linearAxis(`${channel.replace("_", " ")} (${unit.sign})`), yaxis: { ...linearAxis(`share per ${unit.sign}`), rangemode: "tozero" }, bargap: 0 },
  };
};
