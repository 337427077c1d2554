// The sensors or recordings that are compared, and the verdicts on them in sentences and tables.

const LETTERS = "abcdef";
let chosen = []; // { name, key, sensor, recording, row }
let growthOf = { axes: "worst", error: "heading", window: 60, time: 600 };
let crossed = 10; // s, position of the crosshair

// The default of a sensor is its longest recording; a usable, measured one is preferred.
function recordingOf(key) {
  const [sensor, ...rest] = key.split("/");
  const own = pageData.recordings.filter((row) => row.sensor === sensor && (rest.length === 0 || row.recording === rest.join("/")));
  const order = (row) => [row.decides ? 0 : 1, row.simulated ? 1 : 0, -row.seconds];
  return own.sort((a, b) => order(a).map((one, i) => one - order(b)[i]).find((one) => one !== 0) ?? 0)[0];
}

function chosenFrom(keys) {
  const found = keys.map((key) => ({ key, row: recordingOf(key) })).filter(({ row }) => row);
  const several = (sensor) => found.filter(({ row }) => row.sensor === sensor).length > 1;
  return found.map(({ key, row }) => ({ name: `${nameOf(row.sensor)}${several(row.sensor) ? ` ${row.recording}` : ""}`, key, row, sensor: row.sensor, recording: row.recording }));
}

const channelFor = (one, channel) => pageData.channels.find((view) => view.sensor === one.sensor && view.recording === one.recording && view.channel === channel);

// Colour and mark are the sensor's; of two recordings of one, the dash and a hollow mark differ.
function lookOfChosen(one) {
  const look = pageData.looks.sensors[one.sensor];
  const before = chosen.slice(0, chosen.indexOf(one)).filter((other) => other.sensor === one.sensor).length;
  return before === 0 ? look : { ...look, dash: ["dash", "dot", "dashdot", "longdash", "longdashdot"][(before - 1) % 5], marker: `${look.marker}-open`, plain: look.marker };
}

function startComparison(root) {
  const pickers = root.querySelector(".pickers");
  if (!pickers) return;
  // The reader's own sensor, then usable, sold and measured ones, with many axes.
  const order = (sensor) => {
    const row = recordingOf(sensor);
    const axes = pageData.channels.filter((view) => view.sensor === sensor && view.recording === row.recording).length;
    return [sensor !== mine, !row.decides, !row.sold, row.simulated, -axes].map(Number);
  };
  const sensors = [...new Set(pageData.recordings.map((row) => row.sensor))]
    .sort((a, b) => order(a).map((one, i) => one - order(b)[i]).find((one) => one !== 0) ?? 0);
  const stated = [...LETTERS].map((letter) => state.get(letter)).filter(Boolean);
  const kept = chosenFrom(stated);
  const others = pageData.recordings.length > sensors.length && sensors.length === 1 ? pageData.recordings.map((row) => `${row.sensor}/${row.recording}`) : sensors;
  chosen = kept.length > 1 ? kept : chosenFrom([...new Set([...kept.map((one) => one.key), ...others])].slice(0, 2));
  if (chosen.length < 2 && pageData.recordings.length > 1) {
    chosen = chosenFrom([...new Set([...chosen.map((one) => `${one.sensor}/${one.recording}`), ...pageData.recordings.map((row) => `${row.sensor}/${row.recording}`)])].slice(0, 2));
  }
  if (stated.length !== kept.length) {
    root.querySelector(".unfound").textContent = `Not in this report, or without a curve: ${stated.filter((key) => !recordingOf(key)).join(", ")}.`;
  }
  const axes = Object.keys(CHANNEL_NAMES).filter((name) => pageData.channels.some((view) => view.channel === name));
  const common = axes.filter((name) => chosen.every((one) => channelFor(one, name)));
  chosenChannel = state.get("axis") ?? common[0] ?? axes[0];
  if (!axes.includes(chosenChannel)) chosenChannel = common[0] ?? axes[0];
  chosenMethod = "recommended";
  startGrowth(root);
  crossed = Number(state.get("tau")) || 10;
  drawPickers(pickers, axes);
  compareChosen(root);
}

const signOf = (look) => element("span", { className: "sign", innerHTML: swatch(look) });

function drawPickers(pickers, axes) {
  const root = pickers.closest("main");
  const again = (focus) => {
    LETTERS.split("").forEach((letter, place) => keep(letter, chosen[place]?.key ?? null));
    drawPickers(pickers, axes);
    pickers.querySelector(focus)?.focus();
    compareChosen(root);
    redrawAll();
  };
  const selects = chosen.map((one, place) => {
    const select = element("select");
    select.dataset.letter = LETTERS[place];
    for (const sensor of new Set(pageData.recordings.map((row) => row.sensor))) {
      const own = pageData.recordings.filter((row) => row.sensor === sensor);
      const name = `${nameOf(sensor)}${own.every((row) => row.sold) ? "" : " (not sold)"}`;
      const group = element("optgroup", { label: name }, new Option(own.length > 1 ? `${name}: ${recordingOf(sensor).recording} (default)` : name, sensor));
      if (own.length > 1) own.filter((row) => row !== recordingOf(sensor)).forEach((row) => group.append(new Option(`${name}: ${row.recording}`, `${sensor}/${row.recording}`)));
      select.append(group);
    }
    select.value = one.key;
    if (select.selectedIndex < 0) select.value = one.sensor;
    select.addEventListener("change", () => {
      const keys = chosen.map((each) => each.key);
      keys[place] = select.value;
      chosen = chosenFrom(keys);
      again(`select[data-letter=${LETTERS[place]}]`);
    });
    const label = labelled(`Sensor ${place + 1}`, select);
    label.prepend(signOf({ ...lookOfChosen(one), marker: lookOfChosen(one).plain ?? lookOfChosen(one).marker }));
    if (chosen.length < 3) return label;
    const remove = element("button", { type: "button", textContent: "×", className: "remove", onclick: () => {
      chosen = chosenFrom(chosen.filter((other) => other !== one).map((other) => other.key));
      again("select");
    } });
    remove.setAttribute("aria-label", `Remove ${one.name}`);
    return element("span", {}, label, remove);
  });
  const more = element("button", { type: "button", textContent: "Add a sensor", hidden: chosen.length >= Math.min(LETTERS.length, pageData.recordings.length), onclick: () => {
    const used = new Set(chosen.map((one) => `${one.sensor}/${one.recording}`));
    const next = pageData.recordings.find((row) => !chosen.some((one) => one.sensor === row.sensor))
      ?? pageData.recordings.find((row) => !used.has(`${row.sensor}/${row.recording}`));
    const key = chosen.some((one) => one.sensor === next.sensor) ? `${next.sensor}/${next.recording}` : next.sensor;
    chosen = chosenFrom([...chosen.map((one) => one.key), key]);
    again(`select[data-letter=${LETTERS[chosen.length - 1]}]`);
  } });
  pickers.replaceChildren(...selects, more, axisChooser("compared", axes, () => {
    startGrowth(root);
    compareChosen(root);
    redrawAll();
  }));
}

// Each figure of the chosen channels: its name, the value of each recording, and the ratio of the
// first to each other.
function comparedFigures() {
  const views = chosen.map((one) => channelFor(one, chosenChannel));
  if (views.some((view) => !view)) return [];
  const quantity = quantityOf(chosenChannel);
  const figures = pageData.compared.flatMap((symbol) => {
    const own = views.map((view) => {
      const [value, lower, upper, status] = view.parameters[view.recommended]?.[symbol]?.[0] ?? [];
      return value === undefined ? null : { value, lower, upper, status };
    });
    if (own.includes(null)) return [];
    const ratios = own.slice(1).map((other) => ratioOfParameters(own[0], other));
    return [{ symbol, label: symbolText(symbol), term: symbol, long: FOREST_NAMES[symbol] ?? symbolText(symbol), unit: unitOf(quantity, symbol), own, ratios, drawn: true }];
  });
  const pairs = views.slice(1).map((view) => ratiosOfDeviations(views[0].drawn, view.drawn));
  const whole = (pairs[0] ?? []).filter(({ tau }) => Number.isInteger(Math.log10(tau)) && tau >= 1)
    .filter(({ tau }) => pairs.every((ratios) => ratios.some((one) => one.tau === tau)));
  for (const { tau } of whole) {
    const at = pairs.map((ratios) => ratios.find((one) => one.tau === tau));
    const values = [at[0].values[0], ...at.map((one) => one.values[1])];
    figures.push({
      symbol: "adev", tau, label: `σ(${numberText(tau, 4)} s)`, term: "allan_deviation", unit: unitOf(quantity, "adev"),
      own: values.map((value) => ({ value, lower: null, upper: null, status: "ok" })), ratios: at,
    });
  }
  return figures;
}

// Less noise is better.
function verdictOf(ratio, first, second) {
  const better = { lower: first, higher: second }[ratio.verdict];
  return better ? { text: `${better.name} has less noise`, better, kind: "significant" } : { text: ratio.verdict, kind: ratio.verdict === "not determined" ? "unknown" : "even" };
}

function compareChosen(root) {
  drawVerdicts(root, comparedFigures());
  drawEvidence(root);
  drawRequirements(root);
  drawErrors(root);
}

const cellOf = (text, more = {}, ...inside) => element("td", { textContent: text, ...more }, ...inside);

function verdictCell(ratio, first, second) {
  const { text, kind, better } = verdictOf(ratio, first, second);
  const cell = cellOf("", { className: `judged ${kind}` });
  if (better) cell.append(signOf({ ...pageData.looks.sensors[better.sensor], line: false }));
  cell.append(text);
  if (ratio.reasons.length > 0) cell.append(" ", element("span", { className: "why", textContent: `(${ratio.reasons.join("; ").replaceAll("the first", first.name).replaceAll("the second", second.name)})` }));
  return cell;
}

function ratioCell(ratio) {
  const cell = cellOf("", { className: "number ratio" });
  Object.assign(cell.dataset, { ratio: ratio.value ?? "", lower: ratio.lower ?? "", upper: ratio.upper ?? "" });
  const digits = countDigits(ratio.value, ratio.lower, ratio.upper);
  if (ratio.value === null) cell.append(ratioText(ratio));
  else cell.append(element("strong", { textContent: numberText(ratio.value, digits) }), element("br"), element("small", { textContent: `(${ratioText(ratio)})` }));
  return cell;
}

function ownCell(one, unit) {
  const cell = cellOf("", { className: "number" });
  const shown = typeof unit === "function" ? unit(one.value) : unit;
  const [value, limits] = estimateTexts(one.value, one.lower, one.upper, shown);
  const bound = one.status === "absent" && one.upper !== null ? `${limits} ${shown.sign}` : statusText(one.status);
  cell.append(one.value !== null ? `${value} ${shown.sign}` : bound);
  if (one.value !== null && one.lower !== null && one.upper !== null) cell.append(element("br"), element("small", { textContent: `(${limits})` }));
  return cell;
}

const headOf = (...texts) => element("tr", {}, ...texts.map((text) => element("th", { scope: "col", textContent: text })));

function linesOf(figures) {
  return figures.map((figure) => {
    const name = element(figure.term ? "i" : "span", { textContent: figure.label });
    if (figure.term) name.dataset.term = figure.term;
    const judged = figure.ratios.flatMap((ratio, place) => [verdictCell(ratio, chosen[0], chosen[place + 1]), ratioCell(ratio)]);
    const row = element("tr", {}, element("th", { scope: "row" }, name), ...judged, ...figure.own.map((one) => ownCell(one, figure.unit)));
    row.dataset.figure = figure.tau ? `adev ${figure.tau}` : figure.symbol;
    return row;
  });
}

function headsOfPairs() {
  return chosen.slice(1).flatMap((other) => [chosen.length > 2 ? `Verdict: ${chosen[0].name} or ${other.name}` : "Verdict", `Ratio ${chosen[0].name} / ${other.name} (95 % interval)`]);
}

function drawVerdicts(root, figures) {
  const table = root.querySelector("table.verdicts");
  const missing = chosen.filter((one) => !channelFor(one, chosenChannel));
  table.tHead.replaceChildren(headOf("Figure", ...headsOfPairs(), ...chosen.map((one) => one.name)));
  table.tBodies[0].replaceChildren(...linesOf(figures));
  table.caption.textContent = `${CHANNEL_NAMES[chosenChannel]}: noise of the sensors and its ratio. A difference is significant where the 95 % interval of the ratio excludes 1`;
  table.closest(".scroll").hidden = missing.length > 0;
  root.querySelector("figure[data-kind=pair]").hidden = missing.length === chosen.length;
  root.querySelector("figure[data-kind=dumbbells]").hidden = missing.length > 0;
  const common = Object.keys(CHANNEL_NAMES).filter((name) => chosen.every((one) => channelFor(one, name)));
  const instead = common.length > 0 ? `choose ${common.map((name) => CHANNEL_NAMES[name]).join(" or ")}` : "they have no axis in common";
  const words = missing.length > 0
    ? [`${missing.map((one) => one.name).join(" and ")} recorded no ${CHANNEL_NAMES[chosenChannel]}: ${instead}.`]
    : chosen.slice(1).map((other, place) => sentenceOf(figures, chosen[0], other, place));
  root.querySelector(".answer").textContent = words.join("\n");
  root.querySelector(".stands").textContent = chosen.filter((one) => !one.key.includes("/"))
    .map((one) => ({ one, others: pageData.recordings.filter((row) => row.sensor === one.sensor).length - 1 })).filter(({ others }) => others > 0)
    .map(({ one, others }) => `${one.name}: ${one.recording} is shown, ${one.row.decides ? "the longest usable recording" : "the longest recording, not used in rankings"}${one.row.simulated ? " (simulated)" : ""}; ${others} more above.`).join(" ");
  const doubted = chosen.filter((one) => doubtsOf(one).length > 0);
  root.querySelector(".doubts").textContent = doubted.map((one) => `Warnings for ${one.name}: ${doubtsOf(one).join(", ")}.`).join(" ");
}

const doubtsOf = ({ row }) => [...row.doubts, ...(row.decides ? [] : ["not used in rankings"])];

function sentenceOf(figures, first, second, place) {
  const groups = new Map();
  for (const figure of figures) {
    const ratio = figure.ratios[place];
    const { text, kind } = verdictOf(ratio, first, second);
    const times = ratio.value === null ? "" : ` (factor ${numberText(ratio.value < 1 ? 1 / ratio.value : ratio.value, 2)})`;
    if (!groups.has(text)) groups.set(text, { better: kind === "significant", of: [] });
    groups.get(text).of.push((figure.tau ? `σ(${numberText(figure.tau, 4)} s)` : symbolText(figure.symbol)) + (kind === "significant" ? times : ""));
  }
  const parts = [...groups].sort(([, a], [, b]) => b.better - a.better).map(([text, { of }]) => `${text}: ${of.join(", ")}`);
  const pair = chosen.length > 2 ? `${first.name} or ${second.name}? ` : "";
  return parts.length > 0 ? `${pair}${parts.join("; ")}.` : "";
}

function drawEvidence(root) {
  const table = root.querySelector("table.evidence");
  table.tHead.replaceChildren(headOf("Compared", "Recording", "Hours", "Specimens", "Temperature", "Rate", "Warnings"));
  table.tBodies[0].replaceChildren(...chosen.map((one) => {
    const { row } = one;
    const own = pageData.recordings.filter((other) => other.sensor === one.sensor);
    const named = cellOf("", {}, element("a", { href: row.page.split("/").map(encodeURIComponent).join("/"), textContent: row.recording }));
    if (row.simulated) named.append(" ", element("span", { className: "badge", textContent: "simulated" }));
    if (own.length > 1 && !one.key.includes("/")) named.append(` (longest of ${own.length})`);
    const specimens = new Set(own.map((other) => other.device)).size;
    return element("tr", {}, element("th", { scope: "row", textContent: one.name }), named,
      cellOf(numberText(row.seconds / 3600, 3), { className: "number" }), cellOf(`${specimens}, in ${own.length} ${own.length === 1 ? "recording" : "recordings"}`),
      cellOf(row.temperature ?? "not logged"), cellOf(`${row.rate} Hz`, { className: "number" }), cellOf(doubtsOf(one).join(", ") || "none", { className: "words" }));
  }));
}
