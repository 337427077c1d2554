// Numbers as they are printed, and the units that the reader chose.
// Constants in capitals are written by `publish`: UNITS (quantity -> choice -> symbol -> [sign, factor
// from SI, [fewest, most digits]]), DIGITS (of other values), STATUS_NAMES, SYMBOL_TEXTS, TERMS, and the colours of terms.

const SUPERSCRIPTS = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

function numberText(value, digits) {
  if (Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const rounded = Number(value.toPrecision(digits));
  if (rounded === 0 || (Math.abs(rounded) >= 1e-4 && Math.abs(rounded) < 1e6)) return String(rounded).replaceAll("-", "−");
  const [mantissa, exponent] = rounded.toExponential().split("e");
  return `${mantissa.replaceAll("-", "−")}×${powerText(exponent)}`;
}

const powerText = (exponent) => `10${[...String(exponent).replace("+", "")].map((sign) => SUPERSCRIPTS[sign]).join("")}`;

// Digits of a value and its limits by the width of its interval; as `count_digits` of
// imubench_pipeline.words.numbers.
function countDigits(value, lower, upper, [least, most] = DIGITS) {
  const firstDigit = (number) => Math.floor(Math.log10(number) + 1e-9);
  let digits = 3;
  if (value === null) lower ??= 0;
  if (lower !== null && upper !== null && upper > lower) {
    const half = (upper - lower) / 2;
    if (!Number.isFinite(half)) return least;
    const largest = Math.max(Math.abs(lower), Math.abs(upper));
    const place = firstDigit(half) - (half < 2 * 10 ** firstDigit(half) ? 1 : 0);
    digits = firstDigit(Math.abs(value || largest)) - place + 1;
    digits = Math.max(digits, Math.ceil(Math.log10(largest / (upper - lower))) + 1);
  }
  return Math.min(Math.max(digits, least), most);
}

function interval(low, high, digits = 3) {
  return Number.isFinite(low) && Number.isFinite(high) ? `${numberText(low, digits)} to ${numberText(high, digits)}` : "not known";
}

// An SI value and its interval, or an upper limit, in a unit.
function estimateTexts(value, lower, upper, unit) {
  const sizes = [value, lower, upper].map((size) => (size === null ? null : size * unit.factor));
  const digits = countDigits(...sizes, unit.digits);
  const bound = value === null && !lower && upper !== null;
  const limits = bound ? `below ${numberText(sizes[2], digits)}` : interval(sizes[1], sizes[2], digits);
  return [value === null ? "–" : numberText(sizes[0], digits), limits];
}

const chosenUnits = {};

const symbolText = (symbol) => SYMBOL_TEXTS[symbol] ?? symbol;
const statusText = (status) => STATUS_NAMES[status] ?? status.replaceAll("_", " ");
const symbolMarkup = (symbol) => symbolText(symbol).replace(/_(\w+)/, "<sub>$1</sub>");

function unitOf(quantity, symbol) {
  const [sign, factor, digits] = UNITS[quantity][chosenUnits[quantity]][symbol];
  return { sign, factor, digits };
}

function remembered(key) {
  try {
    return window.localStorage.getItem(key);
  } catch {
    return null; // a page opened from disk may have no storage
  }
}

function remember(key, value) {
  try {
    window.localStorage.setItem(key, value);
  } catch {
    // then the choice lasts as long as the page
  }
}

function startUnits(first) {
  for (const [quantity, choices] of Object.entries(UNITS)) {
    const before = Object.keys(choices)[Number(state.get(quantity) ?? -1)] ?? remembered(`imubench ${quantity}`);
    chosenUnits[quantity] = before in choices ? before : first[quantity];
  }
  document.querySelectorAll("select[data-quantity]").forEach((select) => {
    select.value = chosenUnits[select.dataset.quantity];
    select.addEventListener("change", () => {
      chosenUnits[select.dataset.quantity] = select.value;
      remember(`imubench ${select.dataset.quantity}`, select.value);
      keep(select.dataset.quantity, String(select.selectedIndex));
      showUnits(document);
      redrawAll();
    });
  });
}

// A figure in the text is <data value=SI>; it has data-unit="gyro.N", or the head of its column has
// it. It, or its cell, states its digits if they are not the usual ones of the unit. A unit in the text is a <span data-sign="gyro.N">.
function showUnits(root) {
  root.querySelectorAll("data").forEach((element) => {
    const of = element.dataset.unit ?? unitOfColumn(element.closest("td"));
    const unit = unitOf(...of.split("."));
    const digits = element.closest("[data-digits]")?.dataset.digits ?? countDigits(null, null, null, unit.digits);
    element.textContent = numberText(Number(element.value) * unit.factor, Number(digits));
  });
  root.querySelectorAll("[data-sign]").forEach((element) => {
    element.textContent = unitOf(...element.dataset.sign.split(".")).sign;
  });
}

const unitOfColumn = (cell) => cell.closest("table").tHead.rows[0].cells[cell.cellIndex].dataset.unit;
