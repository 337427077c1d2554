// A device over time: each estimate, and the prediction from earlier recordings.

kinds.trend = (figure) => {
  const trend = pageData.trends[figure.dataset.trend];
  const unit = unitOf(quantityOf(trend.channel), trend.parameter === "bias" ? "signal" : trend.parameter);
  const x = trend.dated ? trend.started : trend.recordings;
  const factor = (values) => values.map((value) => (value === null ? null : value * unit.factor));
  const [value, lower, upper, expectedLow, expectedHigh] =
    [trend.value, trend.lower, trend.upper, trend.expected_lower, trend.expected_upper].map(factor);
  const look = sensorLook();
  const { ink, mark } = inks();
  const changed = trend.verdict.map((word) => word === "changed");
  const traces = [
    ...band(x, expectedLow, expectedHigh, look, 0.2, { group: "expected" }),
    {
      group: "value", type: "scatter", mode: "lines+markers", x, y: value, connectgaps: false,
      line: { color: faint(colourOf(black()), 0.35), width: 1 },
      marker: { color: changed.map((is) => (is ? mark : ink)), size: changed.map((is) => (is ? 12 : 7)), symbol: changed.map((is) => (is ? "star" : "circle")) },
      error_y: {
        type: "data", symmetric: false, color: ink, thickness: 1.2, width: 3,
        array: value.map((each, i) => (each === null || upper[i] === null ? 0 : upper[i] - each)),
        arrayminus: value.map((each, i) => (each === null || lower[i] === null ? 0 : each - lower[i])),
      },
      text: value.map((each, i) => `${trend.recordings[i]}<br>${symbolText(trend.parameter)} ${each === null ? "not known" : `<b>${estimateTexts(trend.value[i], trend.lower[i], trend.upper[i], unit)[0]} ${unit.sign}</b>`}<br>${trend.verdict[i] ?? ""}`),
      hovertemplate: "%{text}<extra></extra>",
    },
  ];
  return {
    traces,
    groups: [
      { key: "value", label: "estimate with 95 % interval", on: true, look: { ...black(), marker: "circle" } },
      { key: "expected", label: "expected from the earlier recordings (95 %)", on: true, look: { ...look, filled: true } },
    ],
    layout: {
      xaxis: { ...linearAxis(trend.dated ? "" : "recordings by name"), type: trend.dated ? "date" : "category", nticks: 8 },
      yaxis: linearAxis(`${trend.parameter === "bias" ? "fixed bias" : symbolMarkup(trend.parameter)} (${unit.sign})`),
    },
  };
};
