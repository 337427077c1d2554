// The ratio of a figure of two recordings, with its interval: the same calculation and the same
// numbers as in `imubench_pipeline.navigation.ratios`.

const RATIO_TAIL = 0.025;

// The ratio of { value, lower, upper, status }; limits by the MOVER method on logarithms.
function ratioOfParameters(first, second) {
  const reasons = [["the first", first], ["the second", second]]
    .filter(([, one]) => one.status !== "ok").map(([which, one]) => `the value of ${which} is ${statusText(one.status)}`);
  if (!first.value || !second.value) {
    let low = over(first.lower ?? 0, second.upper);
    const high = over(first.upper, second.lower);
    if (high === null && !low) low = null;
    return ratioOf(null, low, high, reasons);
  }
  const middle = Math.log(first.value / second.value);
  const below = together(distance(first.lower, first.value), distance(second.value, second.upper));
  const above = together(distance(first.value, first.upper), distance(second.lower, second.value));
  return ratioOf(
    first.value / second.value,
    below === null ? null : Math.exp(middle - below),
    above === null || above === Infinity ? null : Math.exp(middle + above),
    reasons,
  );
}

const over = (numerator, denominator) => (numerator === null || !denominator ? null : numerator / denominator);
const distance = (low, high) => (low === null || high === null ? null : low > 0 ? Math.log(high / low) : Infinity);
const together = (...sides) => (sides.includes(null) ? null : Math.hypot(...sides));

function ratioOf(value, lower, upper, reasons) {
  const limited = lower !== null && (upper !== null || lower > 0);
  let verdict = limited ? "not significant" : "not determined";
  if (upper !== null && upper < 1) verdict = "lower";
  else if (lower !== null && lower > 1) verdict = "higher";
  return { value, lower, upper, reasons, verdict };
}

// The ratios of the Allan deviations of two channels at each tau of both logs, over all pairs of
// drawn models.
function ratiosOfDeviations(first, second) {
  if (!first || !second) return [];
  const step = (tau) => Math.round(2 * Math.log10(tau));
  const places = new Map(array(second.tau).map((tau, place) => [step(tau), place]));
  return array(first.tau).flatMap((tau, place) => {
    const other = places.get(step(tau));
    return other === undefined ? [] : [{ tau: 10 ** (step(tau) / 2), ...deviationRatio(first, place, second, other) }];
  });
}

function deviationRatio(first, place, second, other) {
  const value = array(first.adev)[place] / array(second.adev)[other];
  const [own, theirs] = [drawnAt(first, place), drawnAt(second, other)];
  const pairs = new Float64Array(own.length * theirs.length);
  own.forEach((a, i) => theirs.forEach((b, j) => (pairs[i * theirs.length + j] = a / b)));
  pairs.sort();
  const at = (share) => pairs[Math.max(0, Math.ceil(pairs.length * share - 1e-9) - 1)];
  const unknown = [...new Set([first.unknown[place] ?? [], second.unknown[other] ?? []].flat())];
  const limits = [Math.min(at(RATIO_TAIL), value), Math.max(at(1 - RATIO_TAIL), value)];
  return {
    ...ratioOf(unknown.length > 0 ? null : value, ...limits, unknown),
    values: [array(first.adev)[place], array(second.adev)[other]],
  };
}

function drawnAt(channel, place) {
  const every = array(channel.drawn);
  const draws = every.length / array(channel.tau).length;
  return every.slice(place * draws, (place + 1) * draws);
}

function ratioText({ value, lower, upper }) {
  const digits = countDigits(value, lower, upper);
  if (lower === null && upper === null) return "–";
  if (upper === null) return `above ${numberText(lower, digits)}`;
  if (!lower) return `below ${numberText(upper, digits)}`;
  return `${numberText(lower, digits)} to ${numberText(upper, digits)}`;
}
