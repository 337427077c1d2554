// Allan deviations of several sensors, or of several recordings of one sensor, in one figure.

const CHANNEL_NAMES = Object.fromEntries(["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"].map((name) => [name, name.replace("_", " ")]));
const MANY = 40; // curves beyond which only one recording per sensor is shown at first
let chosenChannel = null;
let chosenMethod = "recommended";
let everyRecording = true;

const quantityOf = (channel) => channel.split("_")[0];

function startChooser(root) {
  const chooser = root.querySelector(".chooser");
  if (!chooser || !pageData.channels || chooser.matches(".pickers")) return;
  const present = Object.keys(CHANNEL_NAMES).filter((name) => pageData.channels.some((view) => view.channel === name));
  if (state.has("axis")) chosenChannel = state.get("axis");
  if (!present.includes(chosenChannel)) chosenChannel = present[0];
  const most = Math.max(0, ...present.map((name) => pageData.channels.filter((view) => view.channel === name).length));
  everyRecording = most <= MANY || pageData.grouped === "recording";
  if (state.has("recordings")) everyRecording = state.get("recordings") === "all";
  const drawable = Object.entries(pageData.looks.methods).filter(([key]) => pageData.channels.some((view) => key in view.models));
  const method = element("select", {}, new Option("recommended", "recommended"), ...drawable.map(([key, look]) => new Option(look.name, key)));
  if (state.has("method")) chosenMethod = state.get("method");
  method.value = chosenMethod;
  if (method.selectedIndex < 0) method.value = chosenMethod = "recommended";
  method.addEventListener("change", () => {
    chosenMethod = method.value;
    keep("method", chosenMethod === "recommended" ? null : chosenMethod);
    redrawAll();
  });
  chooser.append(axisChooser("channel", present, redrawAll), labelled("Model drawn", method));
  if (pageData.grouped === "sensor" && new Set(pageData.channels.map((view) => view.recording)).size > 1) {
    const which = element("select", {}, new Option("all", "all"), new Option("latest of each sensor", "last"));
    which.value = everyRecording ? "all" : "last";
    which.addEventListener("change", () => {
      everyRecording = which.value === "all";
      keep("recordings", which.value);
      redrawAll();
    });
    chooser.append(labelled("Recordings", which));
  }
}

function axisChooser(group, names, act) {
  return element("fieldset", {}, element("legend", { textContent: "Axis" }), ...names.map((name) => {
    const choose = () => {
      chosenChannel = name;
      keep("axis", name);
      act();
    };
    return element("label", {}, element("input", { type: "radio", name: group, value: name, checked: name === chosenChannel, onchange: choose }), ` ${CHANNEL_NAMES[name]}`);
  }));
}

function comparedChannels(channel) {
  const views = pageData.channels.filter((view) => view.channel === channel);
  if (everyRecording) return views;
  return [...new Map(views.map((view) => [view.sensor, view])).values()];
}

// A curve has the style of its sensor, or of its place among the recordings of one sensor.
function lookOf(view) {
  const own = pageData.looks.sensors[view.sensor];
  if (pageData.grouped === "sensor") return own;
  const place = pageData.recordings.indexOf(view.recording);
  return pageData.looks.places[place % pageData.looks.places.length];
}

const groupOf = (view) => (pageData.grouped === "sensor" ? view.sensor : view.recording);
const nameOf = (key) => pageData.names[key] ?? key;

// A printed figure is a power of tau.
const printedLine = (printed, tau, unit) => tau.map((t) => printed.value * unit.factor * t ** printed.slope);

const titleOfView = (view) => `${nameOf(view.sensor)}${view.simulated ? " (simulated)" : ""}, ${view.recording}`;
const curvesOf = (view, unit) => [view.adev, view.lower, view.upper].map((place) => scaled(place, unit.factor));

// A measured curve, its limits on hover.
function curveOf(view, unit, name, more) {
  const [y, low, high] = curvesOf(view, unit);
  const x = array(view.tau);
  return {
    type: "scatter", mode: "lines+markers", x, y, name, meta: { low, high },
    text: x.map((t, i) => `τ ${numberText(t, 3)} s: <b>${numberText(y[i], 3)} ${unit.sign}</b><br>95 %: ${interval(low[i], high[i])} ${unit.sign}`),
    hovertemplate: `${name}<br>%{text}<extra></extra>`, ...more,
  };
}

function limitsOf(view, unit, look, opacity, group) {
  const [, low, high] = curvesOf(view, unit);
  return band(array(view.tau), low, high, look, opacity, { group });
}

kinds.overlay = (figure) => {
  const quantity = quantityOf(chosenChannel);
  const unit = unitOf(quantity, "adev");
  const here = comparedChannels(chosenChannel);
  const traces = [];
  const groups = new Map();
  for (const view of pageData.channels) {
    const key = groupOf(view);
    if (!groups.has(key)) {
      groups.set(key, { key, label: nameOf(key) + (view.simulated ? " (simulated)" : ""), on: true, look: lookOf(view), absent: true });
    }
  }
  for (const view of here) {
    const key = groupOf(view);
    groups.get(key).absent = false;
    const look = lookOf(view);
    const colour = colourOf(look);
    traces.push(...limitsOf(view, unit, look, 0.18, [key, "limits"]), curveOf(view, unit, titleOfView(view), {
      group: [key, "measured"], line: { color: colour, dash: look.dash, width: 1.6 },
      marker: { color: colour, symbol: look.marker, size: array(view.tau).map((_, i) => (i % 8 === 4 ? 7 : 0.1)) },
    }));
    const method = chosenMethod === "recommended" ? view.recommended : chosenMethod;
    if (view.models[method] !== undefined) {
      const [times, curve] = view.models[method];
      traces.push(line(array(times), scaled(curve, unit.factor), { ...look, width: 1.2 }, { group: [key, "model"], opacity: 0.8 }));
    }
  }
  const ranges = {
    x: logRange(here.flatMap((view) => array(view.tau)), 0.1), y: logRange(here.flatMap((view) => scaled(view.adev, unit.factor)), 0.4),
  };
  const slopes = slopeGuides(ranges.x, ranges.y);
  for (const view of here.filter(({ sensor }, i) => here.findIndex((other) => other.sensor === sensor) === i)) {
    const [look, tau] = [lookOf(view), array(view.tau)];
    pageData.datasheets[view.sensor][chosenChannel].forEach((printed) => {
      traces.push(line(tau, printedLine(printed, tau, unit), { ...look, dash: "dot", width: 1.2 }, {
        group: [groupOf(view), "datasheet"], hoverinfo: "text", text: `${nameOf(view.sensor)}, datasheet: ${printed.label}`,
      }));
    });
  }
  const { ink, soft } = inks();
  const plain = { light: ink, dark: ink };
  // Names stand at the ends of the curves, where there is room for them.
  const named = new Map(here.filter((view) => shown(figure, groupOf(view)) && shown(figure, "measured")).map((view) => [groupOf(view), view]));
  const roomy = roomForNames(figure) && named.size <= 12;
  const labels = roomy ? directLabels([...named].map(([key, view]) => ({
    y: Math.log10(scaled(view.adev, unit.factor).at(-1)), text: wrapped(nameOf(key)), colour: colourOf(lookOf(view)),
  })), ranges.y) : [];
  const layers = [
    { key: "measured", layer: true, label: "curves", on: true, look: plain },
    { key: "limits", layer: true, label: "95 % limits", on: here.length <= 12, look: { ...plain, filled: true } },
    { key: "model", layer: true, label: "model", on: false, look: plain },
    { key: "datasheet", layer: true, label: "datasheet", on: false, look: { ...plain, dash: "dot" } },
    { key: "slopes", layer: true, label: "slopes", on: true, look: { light: soft, dark: soft } },
  ];
  return {
    traces, groups: [...layers, ...groups.values()],
    layout: {
      ...(roomy ? { margin: { l: 60, r: 150, t: 14, b: 50 } } : {}),
      xaxis: logAxis("averaging time τ (s)", ranges.x), yaxis: logAxis(`Allan deviation (${unit.sign})`, ranges.y),
      annotations: [...labels, ...(shown(figure, "slopes") ? slopes.annotations : [])], shapes: shown(figure, "slopes") ? slopes.shapes : [],
    },
  };
};

const FOREST_NAMES = {
  N: "N, white noise", B_curve: "B (curve), bias instability", sigma_min: "σ_min, lowest point of the curve",
  B: "B of the first term", T_B: "T_B, correlation time", K: "K, random walk",
};

// Dot and 95 % interval of a parameter; hollow where the value is not estimated.
kinds.forest = (figure) => {
  const symbol = figure.dataset.symbol;
  const quantity = quantityOf(chosenChannel);
  const unit = unitOf(quantity, symbol);
  const overlay = document.querySelector("figure[data-kind=overlay]");
  const here = comparedChannels(chosenChannel).filter((view) => shown(overlay, groupOf(view)));
  const names = [...new Set(here.map(groupOf))].reverse();
  const traces = [];
  const counts = new Map();
  here.map(groupOf).forEach((key) => counts.set(key, (counts.get(key) ?? 0) + 1));
  const seen = new Map();
  const extent = [];
  for (const view of here) {
    const key = groupOf(view);
    const number = seen.get(key) ?? 0;
    seen.set(key, number + 1);
    const method = chosenMethod === "recommended" || !view.parameters[chosenMethod] ? view.recommended : chosenMethod;
    const place = names.indexOf(key) + ((number + 1) / (counts.get(key) + 1) - 0.5) * -0.7;
    const name = titleOfView(view);
    for (const [value, lower, upper, status] of view.parameters[method]?.[symbol] ?? []) {
      const identified = value !== null && status === "ok";
      const bounded = lower !== null && lower > 0 && upper !== null;
      const middle = value ?? (bounded ? Math.sqrt(lower * upper) : upper);
      if (middle === null || middle <= 0) continue;
      extent.push(middle * unit.factor, ...(bounded ? [lower * unit.factor, upper * unit.factor] : []));
      const look = lookOf(view);
      const colour = colourOf(look);
      const [size, between] = estimateTexts(value, lower, upper, unit);
      const words = value !== null ? `<b>${size} ${unit.sign}</b>${identified ? "" : ` (${statusText(status)})`}`
        : status === "absent" ? `${statusText(status)}: ${between} ${unit.sign}` : statusText(status);
      const limits = bounded ? `<br>95 %: ${between} ${unit.sign}` : "";
      traces.push({
        type: "scatter", mode: "markers", x: [middle * unit.factor], y: [place],
        marker: {
          color: identified ? colour : inks().paper, size: identified ? 9 : 8, line: { color: colour, width: identified ? 0 : 2 },
          symbol: identified ? look.marker : status === "absent" ? "triangle-left" : "circle",
        },
        error_x: bounded ? { type: "data", symmetric: false, array: [(upper - middle) * unit.factor], arrayminus: [(middle - lower) * unit.factor], color: colour, thickness: 1.6, width: 4 } : undefined,
        hovertemplate: `${name}<br>${symbolText(symbol)} ${words}${limits}<extra></extra>`,
      });
    }
  }
  const marked = new Set(traces.map((trace) => Math.round(trace.y[0])));
  const unmarked = names.map((_, i) => i).filter((i) => !marked.has(i));
  const most = Math.max(1, ...counts.values());
  const [low, high] = logRange(extent, 0.08);
  const room = 0.04 * (high - low); // for the markers at both ends
  return {
    traces, groups: [], height: 90 + names.length * Math.min(30 + 8 * (most - 1), 130),
    layout: {
      margin: { l: 10, r: 14, t: 30, b: 45 },
      title: { text: FOREST_NAMES[symbol], font: { size: 14 }, x: 0, xanchor: "left", xref: "container", pad: { l: 8 }, y: 0.98, yanchor: "top" },
      xaxis: logAxis(`${symbolMarkup(symbol)} (${unit.sign})`, [low - room, high + room]),
      yaxis: {
        ...linearAxis(""), tickvals: names.map((_, i) => i), ticktext: names.map((key) => wrapped(nameOf(key))),
        range: [-0.6, names.length - 0.4], fixedrange: true,
      },
      annotations: unmarked.map((i) => ({
        xref: "paper", x: 0.01, y: i, xanchor: "left", showarrow: false, text: figure.clientWidth < 560 ? "no value" : "not in the model, or not determined", font: { color: inks().soft, size: 12 },
      })),
    },
  };
};

function wrapped(text) {
  const short = text.length > 34 ? `${text.slice(0, 33)}…` : text;
  return short.length > 18 ? short.replace(/^(.{8,18}) /, "$1<br>") : short;
}
