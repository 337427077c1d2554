// The figures of gyros on a rate table.

const TABLE_POINTS = { light: "#0072B2", dark: "#4DA3D9", marker: "circle" };
const TABLE_LINE = { light: "#D55E00", dark: "#F08A3C", dash: "solid", width: 1.4 };

kinds.table_line = () => {
  const table = pageData.table;
  const unit = unitOf("gyro", "signal");
  const [x, mean, fitted] = ["table_rate", "mean", "line"].map((name) => scaled(table[name], unit.factor));
  const order = x.map((_, i) => i).sort((a, b) => x[a] - x[b]);
  return {
    traces: [
      { ...line(order.map((i) => x[i]), order.map((i) => fitted[i]), TABLE_LINE), group: "line" },
      {
        group: "points", type: "scatter", mode: "markers", x, y: mean, marker: { color: colourOf(TABLE_POINTS), size: 7 },
        text: x.map((at, i) => `rate ${table.number[i]}: ${numberText(at, 6)} ${unit.sign}, read <b>${numberText(mean[i], 6)} ${unit.sign}</b>`), hovertemplate: "%{text}<extra></extra>",
      },
    ],
    groups: [
      { key: "points", label: "mean reading", on: true, look: { ...TABLE_POINTS, line: false } },
      { key: "line", label: "bias and scale factor", on: true, look: TABLE_LINE },
    ],
    layout: { xaxis: linearAxis(`rate of the table (${unit.sign})`), yaxis: linearAxis(`mean reading (${unit.sign})`) },
  };
};

kinds.table_residuals = () => {
  const table = pageData.table;
  const unit = unitOf("gyro", "signal");
  const fine = unitOf("gyro", "adev");
  const x = scaled(table.table_rate, unit.factor);
  const [left, sigma] = ["residual", "sigma"].map((name) => scaled(table[name], fine.factor));
  const ends = [Math.min(...x), Math.max(...x)];
  return {
    traces: [
      { ...line(ends, [0, 0], TABLE_LINE), group: "line" },
      {
        group: "points", type: "scatter", mode: "markers+text", x, y: left, marker: { color: colourOf(TABLE_POINTS), size: 7 },
        error_y: { type: "data", array: sigma.map((value) => 2 * value), color: colourOf(TABLE_POINTS), thickness: 1.2, width: 4 },
        text: table.number.map(String), textposition: "middle right",
        customdata: x.map((at, i) => `rate ${table.number[i]}, ${numberText(at, 6)} ${unit.sign}: <b>${numberText(left[i], 3)} ± ${numberText(2 * sigma[i], 2)} ${fine.sign}</b> (2σ)`), hovertemplate: "%{customdata}<extra></extra>",
      },
    ],
    groups: [
      { key: "points", label: "residual, with 2σ", on: true, look: { ...TABLE_POINTS, line: false } },
      { key: "line", label: "the line", on: true, look: TABLE_LINE },
    ],
    layout: { xaxis: linearAxis(`rate of the table (${unit.sign})`), yaxis: linearAxis(`residual (${fine.sign})`) },
  };
};

const ALIGNED = {
  "1 level": { light: "#5a636b", dark: "#a9b1b8", marker: "square" },
  "2 level": { light: "#9A6B00", dark: "#E0A82E", marker: "diamond" },
  "1 heading": { light: "#D55E00", dark: "#F08A3C", marker: "triangle-up" },
  "2 heading": { light: "#0072B2", dark: "#4DA3D9", marker: "circle" },
};

kinds.alignment = (figure) => {
  const courses = pageData.alignments[figure.dataset.sensor];
  const all = courses.map((course) => [array(course.time), array(course.sigma)]);
  const traces = [];
  const groups = [];
  courses.forEach((course, i) => {
    const key = `${course.positions} ${course.angle} ${course.method}`;
    const look = { ...ALIGNED[`${course.positions} ${course.angle}`], dash: course.method === "fine" ? "solid" : "dot", width: course.method === "fine" ? 2 : 1.4 };
    const [time, sigma] = all[i];
    const what = course.angle === "level" ? "roll and pitch" : "heading";
    const where = course.positions === 1 ? "one position" : "two positions";
    traces.push({
      type: "scatter", mode: "lines+markers", group: key, x: time, y: sigma,
      line: { color: colourOf(look), width: look.width, dash: look.dash }, marker: { color: colourOf(look), symbol: look.marker, size: 5 },
      text: time.map((at, k) => `${what}, ${where}, ${course.method}, ${numberText(at, 4)} s: <b>${numberText(sigma[k], 3)}°</b>`), hovertemplate: "%{text}<extra></extra>",
    });
    groups.push({ key, label: `${what}, ${where}, ${course.method}`, on: true, look });
  });
  return {
    traces, groups,
    layout: {
      xaxis: logAxis("time at rest (s)", logRange(all.flatMap(([time]) => time), 0.05)),
      yaxis: logAxis("σ (°)", logRange(all.flatMap(([, sigma]) => sigma), 0.1)),
    },
  };
};
