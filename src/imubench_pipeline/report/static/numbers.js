// Numbers as they are printed, and the units that the reader chose.
// Constants in capitals are written by `publish`: UNITS (quantity -> choice -> symbol -> [sign, factor
// from SI]), STATUS_NAMES, SYMBOL_TEXTS, TERMS, and the colours of terms.

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

// Digits of limits that differ in print; as `limit_digits` of imubench_pipeline.words.numbers.
function limitDigits(lower, upper, least = 3) {
  if (lower === null || upper === null || !(upper > lower)) return least;
  return Math.min(Math.max(least, Math.ceil(Math.log10(Math.max(Math.abs(lower), Math.abs(upper)) / (upper - lower))) + 1), 7);
}

// Digits of a value and its limits by the width of its interval; as `digits_by` there.
function digitsBy(value, lower, upper, otherwise = 3) {
  if (lower === null || upper === null || !(upper > lower) || !value) return otherwise;
  const firstDigit = (number) => Math.floor(Math.log10(number) + 1e-9);
  const half = (upper - lower) / 2;
  if (!Number.isFinite(half)) return 2;
  const digit = firstDigit(half) - (half < 2 * 10 ** firstDigit(half) ? 1 : 0);
  return Math.min(Math.max(firstDigit(Math.abs(value)) - digit + 1, 2), 7);
}

const chosenUnits = {};

const symbolText = (symbol) => SYMBOL_TEXTS[symbol] ?? symbol;
const statusText = (status) => STATUS_NAMES[status] ?? status.replaceAll("_", " ");
const symbolMarkup = (symbol) => symbolText(symbol).replace(/_(\w+)/, "<sub>$1</sub>");

function unitOf(quantity, symbol) {
  const [sign, factor] = UNITS[quantity][chosenUnits[quantity]][symbol];
  return { sign, factor };
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
// it. Its digits are said by data-digits of it, its cell or its table; else limits, in <small>, have
// 3, and others 4. A unit in the text is a <span data-sign="gyro.N">.
function showUnits(root) {
  root.querySelectorAll("data").forEach((element) => {
    const of = element.dataset.unit ?? unitOfColumn(element.closest("td"));
    const digits = element.dataset.digits ?? element.closest("[data-digits]")?.dataset.digits ?? (element.parentNode.localName === "small" ? 3 : 4);
    element.textContent = numberText(Number(element.value) * unitOf(...of.split(".")).factor, Number(digits));
  });
  root.querySelectorAll("[data-sign]").forEach((element) => {
    element.textContent = unitOf(...element.dataset.sign.split(".")).sign;
  });
}

const unitOfColumn = (cell) => cell.closest("table").tHead.rows[0].cells[cell.cellIndex].dataset.unit;
