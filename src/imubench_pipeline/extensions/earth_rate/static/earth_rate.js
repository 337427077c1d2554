// The figures of gyros that were turned between north and south.

const MANY_TURNS = 60;
const NORTH = { light: "#0072B2", dark: "#4DA3D9", marker: "triangle-up" };
const SOUTH = { light: "#D55E00", dark: "#F08A3C", marker: "triangle-down" };
const TRUE_RATE = { light: "#B3001B", dark: "#FF8F8F", dash: "dash", width: 1.6 };
const COURSES = {
  filter: { light: "#0072B2", dark: "#4DA3D9", dash: "solid", width: 2.4 },
  pairs: { light: "#D55E00", dark: "#F08A3C", dash: "dash" },
  triples: { light: "#9A6B00", dark: "#E0A82E", dash: "dot" },
  smoother: { light: "#5B5FC7", dark: "#A3A6F2", dash: "longdash" },
  known_rate: { light: "#7A4B3A", dark: "#C69A88", dash: "dashdot" },
  known_rate_radians: { light: "#7A4B3A", dark: "#C69A88", dash: "dot" },
};

function ofEarth() {
  return pageData.turned;
}

// Lines from the bottom to the top of a figure, as one trace.
function uprights(x, low, high) {
  return { x: x.flatMap((at) => [at, at, null]), y: x.flatMap(() => [low, high, null]) };
}

kinds.turning = (figure) => {
  const turned = ofEarth();
  const envelope = pageData.samples.envelope[turned.channel];
  const unit = unitOf("gyro", "signal");
  const scale = timeScale(envelope.end);
  const [low, high, mean] = [envelope.low, envelope.high, envelope.mean].map((place) => scaled(place, unit.factor));
  const x = mean.map((_, i) => (envelope.start + ((i + 0.5) * (envelope.end - envelope.start)) / mean.length) / scale.size);
  const look = { light: "#5a636b", dark: "#a9b1b8" };
  const turns = array(turned.turns).map((time) => time / scale.size);
  const finite = (values) => values.filter(Number.isFinite);
  const [bottom, top] = [Math.min(...finite(low)), Math.max(...finite(high))];
  // Many lines would hide the samples, so each turn has a tick at the top instead.
  const marks = uprights(turns, turns.length > MANY_TURNS ? top - 0.05 * (top - bottom) : bottom, top);
  const traces = [
    ...band(x, low, high, look, 0.4).map((trace) => ({ ...trace, group: "envelope" })),
    { ...line(x, mean, black(), { hoverinfo: "skip" }), group: "mean" },
    { ...line(marks.x, marks.y, { ...TRUE_RATE, dash: "solid", width: 0.5 }), group: "turns", opacity: 0.6 },
    {
      group: "turns", type: "scatter", mode: "markers", x: turns, y: turns.map(() => top), marker: { color: colourOf(TRUE_RATE), symbol: "triangle-down", size: 6 },
      text: turns.map((at, i) => `turn ${i + 1} at ${numberText(at * scale.size, 6)} s, detected by ${turned.found_by[i]}`), hovertemplate: "%{text}<extra></extra>",
    },
  ];
  return {
    traces,
    groups: [
      { key: "envelope", label: "smallest and largest sample", on: true, look: { ...look, filled: true } },
      { key: "mean", label: "mean", on: true, look: black() },
      { key: "turns", label: "turning points", on: true, look: { ...TRUE_RATE, dash: "dot", marker: "triangle-down" } },
    ],
    layout: { xaxis: linearAxis(`time (${scale.name})`), yaxis: linearAxis(`${turned.channel.replace("_", " ")} (${unit.sign})`) },
  };
};

kinds.dwells = (figure) => {
  const turned = ofEarth();
  const drift = turned.parts[figure.dataset.part].courses.drift;
  const unit = unitOf("gyro", "adev");
  const [start, stop] = [array(turned.dwells.start), array(turned.dwells.stop)];
  const scale = timeScale(stop[stop.length - 1]);
  const middle = start.map((at, i) => (at + stop[i]) / 2 / scale.size);
  const mean = scaled(turned.dwells.mean, unit.factor);
  const traces = [];
  const x = array(drift.time).map((at) => at / scale.size);
  const value = scaled(drift.value, unit.factor);
  const sigma = scaled(drift.sigma, unit.factor);
  traces.push(
    ...band(x, value.map((v, i) => v - 2 * sigma[i]), value.map((v, i) => v + 2 * sigma[i]), COURSES.smoother).map((trace) => ({ ...trace, group: "band" })),
    { ...line(x, value, COURSES.smoother), group: "drift" },
  );
  const groups = [];
  for (const [key, look, wanted] of [["north", NORTH, true], ["south", SOUTH, false]]) {
    const own = middle.map((_, i) => i).filter((i) => turned.dwells.north[i] === wanted && Number.isFinite(mean[i]));
    traces.push({
      group: key, type: "scatter", mode: "markers", x: own.map((i) => middle[i]), y: own.map((i) => mean[i]),
      marker: { color: colourOf(look), symbol: look.marker, size: 6 },
      text: own.map((i) => `dwell ${i + 1}, ${key}: ${numberText(mean[i], 4)} ${unit.sign}`), hovertemplate: "%{text}<extra></extra>",
    });
    groups.push({ key, label: `axis points ${key}`, on: true, look: { ...look, line: false } });
  }
  groups.push(
    { key: "drift", label: "drift, smoothed", on: true, look: COURSES.smoother },
    { key: "band", label: "2σ of the drift", on: true, look: { ...COURSES.smoother, filled: true } },
  );
  return { traces, groups, layout: { xaxis: linearAxis(`time (${scale.name})`), yaxis: linearAxis(`mean of a dwell (${unit.sign})`) } };
};

kinds.earth_rate = (figure) => {
  const turned = ofEarth();
  const part = turned.parts[figure.dataset.part];
  const unit = unitOf("gyro", "adev");
  const named = Object.keys(COURSES).filter((method) => part.courses[method]);
  const times = named.flatMap((method) => array(part.courses[method].time));
  const [first, last] = [Math.min(...times), Math.max(...times)];
  const scale = timeScale(last);
  const traces = [];
  const groups = [];
  for (const method of named) {
    const course = part.courses[method];
    const look = COURSES[method];
    const x = array(course.time).map((at) => at / scale.size);
    const value = scaled(course.value, unit.factor);
    const sigma = scaled(course.sigma, unit.factor);
    const hasSigma = Number.isFinite(sigma[0]);
    if (hasSigma) {
      traces.push(...band(x, value.map((v, i) => v - 2 * sigma[i]), value.map((v, i) => v + 2 * sigma[i]), look, 0.14)
        .map((trace) => ({ ...trace, group: [method, `${method} band`] })));
    }
    traces.push({
      ...line(x, value, look), group: method, hoverinfo: "text",
      text: value.map((v, i) => `${course.name}<br>${numberText(x[i], 4)} ${scale.name}: <b>${numberText(v, 4)} ${unit.sign}</b>${hasSigma ? ` ± ${numberText(2 * sigma[i], 2)} (2σ)` : ", no σ"}`),
    });
    const label = method.startsWith("known_rate") ? `${course.name} (given the rate: no estimate)` : course.name;
    groups.push({ key: method, label, on: true, look });
    if (hasSigma) groups.push({ key: `${method} band`, label: `2σ of the ${method === "triples" ? "A-B-A differences" : method}`, on: method === "filter" || method === "pairs", look: { ...look, filled: true } });
  }
  const truth = turned.truth * unit.factor;
  traces.push({ ...line([0, last / scale.size], [truth, truth], TRUE_RATE), group: "truth" });
  groups.push({ key: "truth", label: "true rate", on: true, look: TRUE_RATE });
  return {
    traces, groups,
    layout: {
      xaxis: { ...linearAxis(`time (${scale.name})`), range: [(figure.dataset.part === "whole" ? 0 : first) / scale.size, last / scale.size] },
      yaxis: { ...linearAxis(`Earth’s rate (${unit.sign})`), range: part.range.map((value) => value * unit.factor) },
    },
  };
};

kinds.bound = (figure) => {
  const all = figure.dataset.place ? pageData.predictions[figure.dataset.place] : pageData.prediction;
  const bound = all[figure.dataset.over];
  const overDwell = figure.dataset.over === "dwell";
  const unit = unitOf("gyro", "adev");
  const x = array(bound.x);
  const sigma = scaled(bound.sigma, unit.factor);
  const truth = all.truth;
  const look = COURSES.filter;
  const traces = [{
    type: "scatter", mode: "lines+markers", group: "bound", x, y: sigma, line: { color: colourOf(look), width: 1.6 }, marker: { color: colourOf(look), size: 4 },
    text: x.map((at, i) => {
      const relative = array(bound.sigma)[i] / truth;
      const where = overDwell ? `dwells of ${numberText(at, 3)} s` : `${numberText(at, 4)} s`;
      return `${where}, ${bound.turns[i]} turns: <b>${numberText(sigma[i], 3)} ${unit.sign}</b><br>${numberText(100 * relative, 3)} % of the Earth’s rate${relative < 0.5 ? `; heading ${numberText((relative * 180) / Math.PI, 3)}°` : ""}`;
    }),
    hovertemplate: "%{text}<extra></extra>",
  }];
  const groups = [{ key: "bound", label: "smallest σ", on: true, look: { ...look, marker: "circle" } }];
  const shownSigmas = [...sigma];
  if (overDwell && bound.best !== null) {
    const range = [Math.min(...bound.nearly), Math.max(...bound.nearly)];
    traces.push({
      type: "scatter", mode: "markers", group: "best", x: [x[bound.best]], y: [sigma[bound.best]], marker: { color: colourOf(SOUTH), symbol: "diamond", size: 11 },
      text: [`best: ${numberText(x[bound.best], 3)} s`], hovertemplate: "%{text}<extra></extra>",
    });
    traces.push({ ...line(range, [sigma[bound.best], sigma[bound.best]].map((v) => v * 0.97), { ...SOUTH, width: 5 }), group: "nearly" });
    groups.push(
      { key: "best", label: `best dwell, ${numberText(x[bound.best], 3)} s`, on: true, look: { ...SOUTH, line: false, marker: "diamond" } },
      { key: "nearly", label: "less than 1 % worse", on: true, look: { ...SOUTH, marker: undefined } },
    );
  } else {
    all.goals.forEach((goal, place) => {
      const level = goal * truth * unit.factor;
      const own = termLook(place + 1);
      traces.push({ ...line([x[0], x[x.length - 1]], [level, level], own), group: `goal ${place}` });
      shownSigmas.push(level);
      groups.push({ key: `goal ${place}`, label: `${numberText(100 * goal, 3)} % of the Earth’s rate${goal < 0.5 ? ` (heading to ${numberText((goal * 180) / Math.PI, 2)}°)` : ""}`, on: true, look: own });
    });
  }
  return {
    traces, groups,
    layout: {
      xaxis: logAxis(overDwell ? "data in each dwell (s)" : "length of the run (s)", logRange(x, 0.05)),
      yaxis: logAxis(`σ of the Earth’s rate (${unit.sign})`, logRange(shownSigmas, 0.1)),
    },
  };
};

kinds.published_rates = () => {
  const runs = pageData.published;
  const unit = unitOf("gyro", "adev");
  const y = runs.map((_, i) => runs.length - i);
  const value = (key) => runs.map((run) => (run[key] === null ? null : run[key] * unit.factor));
  const [truth, published, simulated, sigma] = ["truth", "published", "simulated", "sigma"].map(value);
  const noise = { light: "#0072B2", dark: "#4DA3D9" };
  const points = (key, x, look, name) => ({
    group: key, type: "scatter", mode: "markers", x, y, marker: { color: colourOf(look), symbol: look.marker, size: 10 },
    text: runs.map((run, i) => (x[i] === null ? "" : `${run.name}, ${name}: <b>${numberText(x[i], 4)} ${unit.sign}</b>`)), hovertemplate: "%{text}<extra></extra>",
  });
  const made = { light: "#5B5FC7", dark: "#A3A6F2", marker: "circle" };
  const printed = { light: "#D55E00", dark: "#F08A3C", marker: "diamond" };
  const upright = uprights([truth[0]], 0.4, runs.length + 0.6);
  return {
    height: 120 + 48 * runs.length,
    traces: [
      { ...line(upright.x, upright.y, TRUE_RATE), group: "truth" },
      {
        group: "noise", type: "scatter", mode: "lines", hoverinfo: "skip", line: { color: faint(colourOf(noise), 0.45), width: 12 },
        x: runs.flatMap((_, i) => [truth[i] - 1.96 * sigma[i], truth[i] + 1.96 * sigma[i], null]), y: y.flatMap((at) => [at, at, null]),
      },
      points("simulated", simulated, made, "simulated, pairs"),
      points("published", published, printed, "published"),
    ],
    groups: [
      { key: "published", label: "published", on: true, look: { ...printed, line: false } },
      { key: "simulated", label: "simulated log (pairs)", on: true, look: { ...made, line: false } },
      { key: "noise", label: "95 % range by the noise", on: true, look: { ...noise, filled: true } },
      { key: "truth", label: "true rate", on: true, look: TRUE_RATE },
    ],
    layout: {
      xaxis: linearAxis(`Earth’s rate (${unit.sign})`),
      yaxis: { ...linearAxis(""), tickmode: "array", tickvals: y, ticktext: runs.map((run) => run.name), range: [0.4, runs.length + 0.6], fixedrange: true },
    },
  };
};
