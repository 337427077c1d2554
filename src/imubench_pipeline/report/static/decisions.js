// The figures that decide: the margin to a requirement, and a device over time.

kinds.margins = (figure) => {
  const standings = pageData.rankings[figure.dataset.requirement].filter((standing) => standing.margin !== null);
  const names = standings.map((standing) => standing.sensor).reverse();
  const { ink, mark, paper } = inks();
  const traces = standings.map((standing) => {
    const look = pageData.looks.sensors[standing.sensor];
    const colour = colourOf(look);
    return {
      type: "scatter", mode: "markers", x: [standing.margin], y: [names.indexOf(standing.sensor)],
      marker: { color: standing.weak ? paper : colour, size: 11, symbol: look.marker, line: { color: colour, width: standing.weak ? 2 : 0 } },
      error_x: standing.low !== null ? {
        type: "data", symmetric: false, array: [standing.high - standing.margin], arrayminus: [standing.margin - standing.low], color: colour, thickness: 2, width: 5,
      } : undefined,
      hovertemplate: `${nameOf(standing.sensor)}: ${standing.verdict}${standing.weak ? `<br>weak evidence: ${standing.weak}` : ""}<br>allowed over expected error: <b>${numberText(standing.margin, 3)}</b><br>95 %: ${interval(standing.low ?? NaN, standing.high ?? NaN)}<extra></extra>`,
    };
  });
  const every = standings.flatMap((standing) => [standing.margin, standing.low, standing.high]).filter((value) => value > 0);
  return {
    traces, groups: [], height: 100 + 34 * names.length,
    layout: {
      margin: { l: 10, r: 14, t: 26, b: 50 },
      xaxis: logAxis("allowed / expected error", logRange([0.5, 2, ...every], 0.12)),
      yaxis: { ...linearAxis(""), tickvals: names.map((_, i) => i), ticktext: names.map((key) => wrapped(nameOf(key))), range: [-0.6, names.length - 0.4], fixedrange: true },
      shapes: [{ type: "line", x0: 1, x1: 1, yref: "paper", y0: 0, y1: 1, line: { color: mark, width: 2 } }],
      annotations: [
        { x: 0, xref: "x", yref: "paper", y: 1, yanchor: "bottom", xanchor: "right", text: "fails ◂ ", showarrow: false, font: { color: ink } },
        { x: 0, xref: "x", yref: "paper", y: 1, yanchor: "bottom", xanchor: "left", text: " ▸ passes", showarrow: false, font: { color: ink } },
      ],
    },
  };
};

kinds.trend = (figure) => {
  const trend = pageData.trends[figure.dataset.trend];
  const unit = unitOf(quantityOf(trend.channel), trend.parameter === "bias" ? "signal" : trend.parameter);
  const x = trend.dated ? trend.started : trend.recordings;
  const factor = (values) => values.map((value) => (value === null ? null : value * unit.factor));
  const [value, lower, upper, expectedLow, expectedHigh] =
    [trend.value, trend.lower, trend.upper, trend.expected_lower, trend.expected_upper].map(factor);
  const look = { light: "#0072B2", dark: "#4DA3D9" };
  const { ink, mark } = inks();
  const changed = trend.verdict.map((word) => word === "changed");
  const traces = [
    ...band(x, expectedLow, expectedHigh, look, 0.2).map((trace) => ({ ...trace, group: "expected" })),
    {
      group: "value", type: "scatter", mode: "lines+markers", x, y: value, connectgaps: false,
      line: { color: faint(colourOf(black()), 0.35), width: 1 },
      marker: { color: changed.map((is) => (is ? mark : ink)), size: changed.map((is) => (is ? 12 : 7)), symbol: changed.map((is) => (is ? "star" : "circle")) },
      error_y: {
        type: "data", symmetric: false, color: ink, thickness: 1.2, width: 3,
        array: value.map((each, i) => (each === null || upper[i] === null ? 0 : upper[i] - each)),
        arrayminus: value.map((each, i) => (each === null || lower[i] === null ? 0 : each - lower[i])),
      },
      text: value.map((each, i) => `${trend.recordings[i]}<br>${symbolText(trend.parameter)} ${each === null ? "not known" : `<b>${numberText(each, 4)} ${unit.sign}</b>`}<br>${trend.verdict[i] ?? ""}`),
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
      xaxis: { ...linearAxis(trend.dated ? "" : "recordings in their order"), type: trend.dated ? "date" : "category", nticks: 8 },
      yaxis: linearAxis(`${trend.parameter === "bias" ? "fixed bias" : symbolMarkup(trend.parameter)} (${unit.sign})`),
    },
  };
};
