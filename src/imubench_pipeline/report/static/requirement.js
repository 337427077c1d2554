// Judges the sensors by a requirement that the reader changes, from a table of their noise models and
// figures (`navigation.verdicts.compact`), with the formulas of `navigation.error_budget` and
// `navigation.verdicts`, where time and temperature change evenly until the time of a limit; a test
// compares both.

const GRAVITY = 9.80665;
const NORMAL_QUANTILE = 1.959963984540054;
const GYRO_ORDER = { attitude: 0, heading: 0, velocity: 1, position: 2, cross_track: 1 };
const ACCEL_ORDER = { velocity: 0, position: 1 };
const FACTORIALS = [1];
for (let n = 1; n < 60; n++) FACTORIALS.push(FACTORIALS[n - 1] * n);

const sum = (numbers) => numbers.reduce((total, one) => total + one, 0);
const ofConstant = (m, t) => t ** (m + 1) / FACTORIALS[m + 1];
const ofWhite = (m, t) => t ** (2 * m + 1) / ((2 * m + 1) * FACTORIALS[m] ** 2);

// phi_k(z) for z = x + i y, with x = 0 or y = 0, as `noise.exponentials.evaluate_phi`; [real, imaginary].
function evaluatePhi(order, x, y = 0) {
  const size = x ** 2 + y ** 2;
  if (size < 4) {
    let [a, b] = [1 / FACTORIALS[order], 0];
    const total = [a, b];
    for (let n = 1; n < 48; n++) {
      [a, b] = [(a * x - b * y) / (n + order), (a * y + b * x) / (n + order)];
      total[0] += a;
      total[1] += b;
    }
    return total;
  }
  let [a, b] = [Math.exp(x) * Math.cos(y), Math.exp(x) * Math.sin(y)];
  for (let j = 0; j < order; j++) {
    a -= 1 / FACTORIALS[j];
    [a, b] = [(a * x + b * y) / size, (b * x - a * y) / size];
  }
  return [a, b];
}

const decay = (order, x) => evaluatePhi(order, -x)[0];
const RESPONSES = [0, 1, 2].map((m) => {
  const single = Array.from({ length: 48 }, (_, n) => (-1) ** n / FACTORIALS[n + m + 1]);
  return single.map((_, n) => sum(single.slice(0, n + 1).map((one, i) => one * single[n - i])) / (2 * m + 3 + n));
});

function integrateSquaredResponse(m, x) {
  if (x < 2) return RESPONSES[m].reduceRight((total, one) => total * x + one, 0);
  let total = -0.5 * decay(m + 1, x) ** 2;
  for (let j = 0; j <= m; j++) total += ((-1) ** j * decay(m + 2 + j, x)) / FACTORIALS[m - j];
  return total / x;
}

// Flicker noise for B = 1 and a motion of 1 s, as in `noise.terms.flicker`.
const FLICKER = [[2], [1, 1 / 3], [1 / 3, 1 / 6, 1 / 30]].map((response, m) => {
  const square = Array(2 * m + 3).fill(0);
  response.forEach((a, i) => response.forEach((b, j) => {
    square[i + j] += (a * b) / (2 * Math.PI);
    square[i + j + 2] -= (a * b) / (2 * Math.PI);
  }));
  const gamma = [0.886226925452758, 1.329340388179137, 3.323350970447843][m]; // of m + 3/2
  return { during: 1 / ((2 * m + 2) * gamma ** 2), logarithmic: square[0], decaying: square.slice(1) };
});
const harmonic = (n) => sum(Array.from({ length: n }, (_, i) => 1 / (i + 1)));

function integrateMotionAndWindow(m, r) {
  if (r >= 4) {
    const moment = (j) => FACTORIALS[j] / FACTORIALS[m + j + 1];
    let total = 1 / FACTORIALS[m + 1] - (harmonic(m + 2) - 1) / FACTORIALS[m + 2] / r;
    total -= Math.log(r) * (moment(0) + moment(1) / r) + moment(1) / r;
    for (let j = 2; j < 28; j++) total -= ((-1) ** j * moment(j)) / (j * (j - 1) * r ** j);
    return total;
  }
  const n = m + 2;
  let power = 0;
  for (let i = 1; i <= n; i++) power += (FACTORIALS[n] / FACTORIALS[i] / FACTORIALS[n - i]) * r ** (i - 1);
  let total = (((1 + r) ** n * Math.log1p(r)) / r - harmonic(n) * power) / FACTORIALS[n];
  for (let i = 0; i <= m; i++) {
    total -= (r ** (n - i - 1) * (Math.log(r) - harmonic(n - i))) / FACTORIALS[n - i] / FACTORIALS[i];
  }
  return -total;
}

function growFlicker(m, t, start) {
  const { during, logarithmic, decaying } = FLICKER[m];
  if (start.window) {
    const [r, c] = [start.window / t, 1 / FACTORIALS[m + 1]];
    const motion = Math.PI * (during + sum(decaying.map((one, i) => one / (2 * (i + 1)))));
    return (motion + c ** 2 * (1.5 - Math.log(r)) - 2 * c * integrateMotionAndWindow(m, r)) / Math.PI;
  }
  const angle = Math.asinh(Math.sqrt(start.on / t));
  return during + logarithmic * angle - sum(decaying.map((one, i) => (one / (2 * (i + 1))) * Math.expm1(-2 * (i + 1) * angle)));
}

// `Term.growth` by symbol, for parameters a and b, order m, time t and a start: {window} or {on}.
const GROWTHS = {
  Q: (a, _, m, t, { window }) => {
    const mean = window ? ofConstant(m, t) / window : 0;
    return a ** 2 * ((m === 0) + (t ** m / FACTORIALS[m] + mean) ** 2 + mean ** 2);
  },
  N: (a, _, m, t, { window }) => a ** 2 * (ofWhite(m, t) + (window ? ofConstant(m, t) ** 2 / window : 0)),
  F: (a, _, m, t, start) => a ** 2 * t ** (2 * m + 2) * growFlicker(m, t, start),
  K: (a, _, m, t, { window, on }) => a ** 2 * (ofWhite(m + 1, t) + ofConstant(m, t) ** 2 * (window ? window / 3 : on)),
  R: (a, _, m, t, { window, on }) => (a * (ofConstant(m + 1, t) + ofConstant(m, t) * (window ? window / 2 : on))) ** 2,
  GM: (B, T, m, t, { window }) => {
    const [x, c, density] = [t / T, ofConstant(m, t), (2 * B ** 2 * Math.LN2) / (Math.PI * 0.4365 ** 2 * T)];
    const driven = t ** (2 * m + 3) * integrateSquaredResponse(m, x);
    if (!window) return density * (driven + ((c * FACTORIALS[m + 1] * decay(m + 1, x)) ** 2 * T) / 2);
    const y = window / T;
    const lost = FACTORIALS[m + 1] * x * decay(m + 2, x) - y * decay(2, y);
    return density * (driven + c ** 2 * (window * integrateSquaredResponse(0, y) + (T * lost ** 2) / 2));
  },
  S: (a, f, m, t, { window }) => {
    const [x, y] = [2 * Math.PI * f * t, 2 * Math.PI * f * (window ?? 0)];
    const [re, im] = evaluatePhi(window ? m + 2 : m + 1, 0, x).map((one) => one * FACTORIALS[m + 1]);
    const [other, less] = evaluatePhi(2, 0, -y);
    const gain = window ? Math.hypot(x * re + y * other, x * im + y * less) : Math.hypot(re, im);
    return 0.5 * (a * ofConstant(m, t) * gain) ** 2;
  },
};

// Variances of the noise of a channel, of its model and of each drawn one.
function growNoise(channel, m, t, start) {
  const total = new Float64Array(channel.size);
  for (const [symbol, first, second] of channel.terms) {
    const unit = second ? null : GROWTHS[symbol](1, 0, m, t, start);
    first.forEach((a, i) => (total[i] += a === 0 ? 0 : second ? GROWTHS[symbol](a, second[i], m, t, start) : a ** 2 * unit));
  }
  return total;
}

// The levers of all figures: [sensor, cause, along, across], across null for an error along one axis.
function listLevers({ error, time: t }, { use, start }) {
  const levers = [];
  const add = (sensor, cause, along, across = null) => levers.push([sensor, cause, along, across]);
  const change = use.temperature_change;
  const scale = (sensor, along, across = null) => {
    add(sensor, "scale_factor", along, across);
    add(sensor, "nonlinearity", along, across);
    if (change) add(sensor, "scale_factor_temperature", change * along, across === null ? null : change * across);
  };
  const gyroFactor = error === "cross_track" ? use.speed : GYRO_ORDER[error] ? GRAVITY : 1;
  const sensors = [["gyro", GYRO_ORDER[error], gyroFactor]];
  if (error in ACCEL_ORDER) sensors.push(["accel", ACCEL_ORDER[error], 1]);
  for (const [sensor, m, factor] of sensors) {
    const c = factor * ofConstant(m, t);
    if (!start.window && start[sensor] === null) {
      add(sensor, "turn_on_bias", c);
      if (sensor === "accel") add(sensor, "misalignment", GRAVITY * c);
    }
    if (change) {
      add(sensor, "temperature", change * (start.window ? (factor * ofConstant(m + 1, t)) / t : c));
      add(sensor, "temperature_squared", change ** 2 * (start.window ? (2 * factor * ofConstant(m + 2, t)) / t ** 2 : c));
    }
    if (error === "heading" && use.turns) scale(sensor, (use.turns * c) / t);
    if (sensor === "accel" && use.speed_change) {
      scale(sensor, (use.speed_change * c) / t, 0);
      add(sensor, "misalignment", 0, (use.speed_change * c) / t);
    }
    if (sensor === "gyro" && use.speed_change) add(sensor, "g_sensitivity", (use.speed_change * c) / t);
    if (use.vibration) {
      const angle = (Math.sqrt(3) * use.vibration) / (2 * Math.PI * use.vibration_frequency);
      if (sensor === "gyro") add(sensor, "g_sensitivity", factor * angle * (m ? ofConstant(m - 1, t) : Math.SQRT2));
      add(sensor, "vibration_rectification", use.vibration ** 2 * c);
    }
  }
  if (use.turns) listTurnLevers(error, t, use, start, add, scale);
  if (error === "attitude" && start.window) {
    add("accel", "turn_on_bias", 1 / GRAVITY);
    add("accel", "misalignment", 1);
  }
  return levers;
}

// As `navigation.error_budget.turns`, at the end of the turn.
function listTurnLevers(error, t, { turns: psi, speed }, start, add, scale) {
  const [cosine, sine, rate] = [Math.cos(psi), Math.sin(psi), psi / t];
  if (error in ACCEL_ORDER) {
    const [about, tilting, lateral] = error === "velocity"
      ? [
          [-speed * (cosine + psi * sine - 1), -speed * (sine - psi * cosine)],
          (GRAVITY / rate) * Math.hypot(1 - cosine, psi - sine),
          [speed * (cosine - 1), speed * sine],
        ]
      : [
          [(speed / rate) * (psi * (cosine + 1) - 2 * sine), (speed / rate) * (psi * sine + 2 * (cosine - 1))],
          (GRAVITY / rate ** 2) * Math.hypot(psi - sine, cosine - 1 + psi ** 2 / 2),
          [(speed / rate) * (sine - psi), (-speed / rate) * (cosine - 1)],
        ];
    scale("gyro", ...about);
    add("gyro", "misalignment", tilting);
    add("gyro", "g_sensitivity", speed * about[0], speed * about[1]);
    add("gyro", "g_sensitivity", speed * tilting);
    scale("accel", ...lateral);
    add("accel", "misalignment", -lateral[1], lateral[0]);
    if (start.window) {
      add("accel", "misalignment", tilting);
      add("accel", "turn_on_bias", tilting / GRAVITY);
    }
  } else if (error === "attitude") {
    const tilt = 2 * Math.sin(Math.min(psi, Math.PI) / 2);
    add("gyro", "misalignment", tilt);
    add("gyro", "g_sensitivity", speed * tilt);
  } else if (error === "heading") add("gyro", "g_sensitivity", speed * psi);
  else {
    const across = (speed / rate) * Math.hypot(psi * sine + cosine - 1, sine - psi * cosine);
    scale("gyro", across);
    add("gyro", "g_sensitivity", speed * across);
  }
}

// Errors of a pair of axes (null: without errors) at a limit: the totals of the model and of each drawn
// one, of noise alone, likely and best, and the parts that are limits of the class.
function computeErrors(limit, requirement, levers, pair, radii) {
  const { error, time: t } = limit;
  const { start } = requirement;
  const factor = error === "cross_track" ? requirement.use.speed : GYRO_ORDER[error] ? GRAVITY : 1;
  const size = Math.max(...Object.values(pair).map((one) => one?.size ?? 1));
  const noise = new Float64Array(size);
  const put = (variances, by) => variances.forEach((one, i) => (noise[i] += by * one));
  if (pair.gyro) put(growNoise(pair.gyro, GYRO_ORDER[error], t, start), factor ** 2);
  if (pair.accel && error in ACCEL_ORDER) put(growNoise(pair.accel, ACCEL_ORDER[error], t, start), 1);
  if (pair.accel && error === "attitude" && start.window) {
    put(growNoise(pair.accel, 0, start.window, { on: 0 }), 1 / (start.window * GRAVITY) ** 2);
  }
  if (!start.window) { // stated biases
    noise.forEach((_, i) => {
      noise[i] += (factor * (start.gyro ?? 0) * ofConstant(GYRO_ORDER[error], t)) ** 2;
      if (error in ACCEL_ORDER) noise[i] += ((start.accel ?? 0) * ofConstant(ACCEL_ORDER[error], t)) ** 2;
    });
  }
  const parts = levers.flatMap(([sensor, cause, along, across]) => {
    const figure = pair[sensor]?.figures[cause];
    return figure ? [{ sensor, cause, along, across, figure }] : [];
  });
  const plane = error in ACCEL_ORDER;
  const total = (variance, sigmaOf) => {
    let [one, both, re, im] = [variance, 0, 0, 0];
    for (const { along, across, figure } of parts) {
      const power = sigmaOf(figure) ** 2;
      if (across === null) one += along ** 2 * power;
      else {
        both += (along ** 2 + across ** 2) * power;
        re += (along ** 2 - across ** 2) * power;
        im += 2 * along * across * power;
      }
    }
    if (!plane) return [Math.sqrt(one + both), 1];
    const [mean, apart] = [one + both / 2, Math.hypot(re, im) / 2];
    const place = (mean ? Math.sqrt(Math.max(mean - apart, 0) / (mean + apart)) : 0) * (radii.length - 1);
    const low = Math.min(Math.floor(place), radii.length - 2);
    const radius = radii[low] + (place - low) * (radii[low + 1] - radii[low]);
    return [radius * Math.sqrt(2 * one + both), radius];
  };
  const [nominal, radius] = total(noise[0], (figure) => figure[0]);
  return {
    nominal,
    noise: total(noise[0], () => 0)[0],
    likely: total(noise[0], (figure) => figure[1] ?? figure[0])[0],
    best: total(noise[0], (figure) => figure[2] ?? figure[0])[0],
    drawn: () => Array.from(noise.slice(1), (one, i) => total(one, (figure) => figure[4]?.[i] ?? figure[0])[0]),
    assumed: parts.filter(({ figure }) => figure[3]).map(({ sensor, cause, along, across, figure }) => ({
      name: `${sensor} ${cause}`,
      sigma: radius * figure[0] * (across === null ? Math.abs(along) * (plane ? Math.SQRT2 : 1) : Math.hypot(along, across)),
    })).filter(({ sigma }) => sigma > 0),
  };
}

function quantile(sorted, share) {
  const place = share * (sorted.length - 1);
  const low = Math.floor(place);
  return sorted[low] + (place - low) * ((sorted[low + 1] ?? sorted[low]) - sorted[low]);
}

// The normal distribution function, after W. J. Cody's form of erfc in "Numerical Recipes" (1.2e-7).
function normalShare(x) {
  const z = Math.abs(x) / Math.SQRT2;
  const t = 1 / (1 + 0.5 * z);
  const series = [0.17087277, -0.82215223, 1.48851587, -1.13520398, 0.27886807, -0.18628806, 0.09678418, 0.37409196, 1.00002368, -1.26551223];
  const tail = 0.5 * t * Math.exp(-z * z + series.reduce((all, one) => all * t + one, 0));
  return x > 0 ? 1 - tail : tail;
}

// As `uncertainty.compute_chance_within`.
function chanceWithin(limit, totals) {
  const logs = totals.map((one) => Math.log(Math.max(one, 1e-300))).sort((a, b) => a - b);
  const mean = sum(logs) / logs.length;
  const deviation = Math.sqrt(sum(logs.map((one) => (one - mean) ** 2)) / logs.length);
  const width = 0.9 * Math.min(deviation, (quantile(logs, 0.75) - quantile(logs, 0.25)) / 1.349) * logs.length ** -0.2;
  const left = logs.map((one) => Math.log(limit) - one);
  return sum(left.map((one) => (width < 1e-12 ? Number(one >= -1e-12) : normalShare(one / width)))) / left.length;
}

// Student's distribution function for whole degrees of freedom, and its 97.5 % quantile.
function studentShare(freedom, t) {
  const angle = Math.atan(t / Math.sqrt(freedom));
  const [sine, cosine] = [Math.sin(angle), Math.cos(angle)];
  const odd = freedom % 2;
  let [term, total] = [odd ? cosine : 1, freedom === 1 ? 0 : odd ? cosine : 1];
  for (let k = odd ? 3 : 2; k < freedom - 1; k += 2) total += term *= (cosine ** 2 * (k - 1)) / k;
  return 0.5 + 0.5 * (odd ? (2 / Math.PI) * (angle + sine * total) : sine * total);
}

function studentQuantile(freedom) {
  let [low, high] = [0, 13];
  for (let i = 0; i < 60; i++) studentShare(freedom, (low + high) / 2) < 0.975 ? (low = (low + high) / 2) : (high = (low + high) / 2);
  return low;
}

// As `navigation.pooled.pool`, for [value, lower, upper] that are positive and in order.
function poolValues(triples) {
  if (triples.length === 1) return { limits: triples[0], error: null, spread: null };
  const logs = triples.map((one) => one.map(Math.log)).sort((a, b) => a[0] - b[0]);
  const middle = logs[Math.floor(logs.length / 2)][0];
  const points = logs.map(([y, low, high]) => {
    const least = (high - low) / 8;
    return [y - middle, (Math.max(y - low, least) / NORMAL_QUANTILE) ** 2, (Math.max(high - y, least) / NORMAL_QUANTILE) ** 2];
  });
  const minimise = (spread) => {
    let [weight, moment] = [0, 0];
    for (const [y, below] of points) {
      weight += 1 / (below + spread);
      moment += y / (below + spread);
    }
    for (const [y, below, above] of points) {
      if (moment / weight <= y) break;
      const more = 1 / (above + spread) - 1 / (below + spread);
      weight += more;
      moment += y * more;
    }
    const mean = moment / weight;
    const weights = points.map(([y, below, above]) => 1 / ((y < mean ? above : below) + spread));
    return [mean, sum(points.map(([y], i) => weights[i] * (y - mean) ** 2)), sum(weights)];
  };
  const freedom = points.length - 1;
  let [low, high] = [0, 0];
  if (minimise(0)[1] > freedom) {
    const average = sum(points.map(([y]) => y)) / points.length;
    high = sum(points.map(([y]) => (y - average) ** 2)) / freedom;
    for (let i = 0; i < 80; i++) minimise((low + high) / 2)[1] > freedom ? (low = (low + high) / 2) : (high = (low + high) / 2);
  }
  const [mean, q, weight] = minimise(high);
  const error = 1 / Math.sqrt(weight);
  const half = Math.max(studentQuantile(freedom) * Math.sqrt(q / freedom), NORMAL_QUANTILE) * error;
  return { limits: [0, -half, half].map((away) => Math.exp(middle + mean + away)), error, spread: high };
}

// As `verdicts.specimens.predict_error`; usual: [variance, freedom] of other sensors, or null.
function predictError(figures, limit, usual) {
  const groups = new Map();
  for (const { device, sigma, lower, upper } of figures) {
    const triple = [sigma, Math.min(Math.max(lower, 1e-4 * sigma), sigma * (1 - 1e-9)), Math.max(upper, sigma * (1 + 1e-9))];
    groups.set(device, [...(groups.get(device) ?? []), triple]);
  }
  if (figures.some(({ sigma }) => sigma <= 0) || (figures.length === 1 && !usual)) {
    return { ...figures.reduce((worst, one) => (one.sigma > worst.sigma ? one : worst)), spread: null };
  }
  const devices = [...groups.values()];
  const predict = (mean, scale, freedom) => {
    const half = studentQuantile(freedom) * scale;
    const [sigma, lower, upper] = [0, -half, half].map((away) => Math.exp(mean + away));
    return { sigma, lower, upper, within: studentShare(freedom, (Math.log(limit) - mean) / scale) };
  };
  if (devices.length === 1 && usual) {
    const [value, lower, upper] = poolValues(devices[0]).limits;
    const error = Math.log(upper / lower) / (2 * NORMAL_QUANTILE);
    return { ...predict(Math.log(value), Math.sqrt(2 * usual[0] + error ** 2), usual[1]), spread: null };
  }
  const values = devices.length === 1 ? devices[0] : devices.map((own) => poolValues(own).limits);
  const { limits, error, spread } = poolValues(values);
  const logs = values.map(([value]) => Math.log(value));
  const mean = sum(logs) / logs.length;
  const variance = sum(logs.map((one) => (one - mean) ** 2)) / (logs.length - 1);
  const together = Math.max(spread, 0.5 * variance);
  return {
    ...predict(Math.log(limits[0]), Math.sqrt(together + error ** 2), values.length - 1),
    spread: devices.length > 1 ? [together, values.length - 1] : null,
  };
}

// Names of the figures on which a limit depends, as `expected_errors.find_largest_figures`.
function listAssumed({ nominal, upper, assumed }, limit) {
  let known = nominal ** 2 - sum(assumed.map(({ sigma }) => sigma ** 2));
  const excess = upper ** 2 - nominal ** 2;
  if (known + excess < limit ** 2) known += excess;
  let room = Math.max(limit ** 2 - known, 0);
  const left = [...assumed].sort((a, b) => a.sigma - b.sigma);
  while (left.length && left[0].sigma ** 2 <= room / left.length) room -= left.shift().sigma ** 2;
  return room > 0 ? [...new Set(left.map(({ name }) => name))] : [];
}

// The errors of each recording of a sensor at a limit; none without a needed axis.
function measureErrors(sensor, limit, requirement, levers, radii) {
  const needs = limit.error === "heading" || limit.error === "cross_track" ? ["gyro"] : ["gyro", "accel"];
  return sensor.recordings.flatMap((recording) => {
    const pair = {};
    for (const quantity of needs) {
      const own = recording.channels.filter((one) => one.quantity === quantity);
      const parts = own.map((one) => computeErrors(limit, requirement, levers, { [quantity]: one }, radii).nominal);
      const ranked = own.map((_, i) => i).sort((a, b) => parts[a] - parts[b]);
      pair[quantity] = own[ranked[requirement.axis === "worst" ? ranked.length - 1 : Math.floor(ranked.length / 2)]];
    }
    if (needs.some((quantity) => !pair[quantity])) return [];
    const errors = computeErrors(limit, requirement, levers, pair, radii);
    const drawn = errors.drawn().sort((a, b) => a - b);
    const lower = Math.min(quantile(drawn, 0.025), errors.nominal);
    const upper = Math.max(quantile(drawn, 0.975), errors.nominal);
    return [{ ...errors, device: recording.device, sigma: errors.nominal, lower, upper, within: chanceWithin(limit.sigma, drawn) }];
  });
}

function judgeLimit(figures, limit, usual) {
  if (figures.length === 0) return { verdict: "not_enough_data", margin: null, assumed: [] };
  const expected = predictError(figures, limit.sigma, usual);
  const away = ({ sigma }) => Math.abs(expected.sigma && sigma ? Math.log(sigma / expected.sigma) : sigma - expected.sigma);
  const own = figures.reduce((nearest, one) => (away(one) < away(nearest) ? one : nearest));
  const divide = (sigma) => (sigma ? limit.sigma / sigma : Infinity);
  const margin = divide(expected.sigma);
  const other = (sigma) => (sigma > 0 ? (margin * own.sigma) / sigma : Infinity);
  const assumed = listAssumed(own, limit.sigma);
  const chance = expected.within;
  let verdict = chance >= 0.5 ? "likely_meets" : "likely_fails";
  if (chance >= 0.975) verdict = "meets";
  else if (assumed.length && chance < 0.5 && other(own.best) >= 1) verdict = "meets_if";
  else if (chance <= 1 - 0.975) verdict = "fails";
  else if (own.lower <= 0 || own.upper / own.lower > 4) verdict = "not_enough_data";
  return { verdict, margin, margins: [divide(expected.upper), divide(expected.lower)], noise: other(own.noise), assumed, chance };
}

const WORST_FIRST = ["fails", "likely_fails", "not_enough_data", "meets_if", "likely_meets", "meets"];

// Returns the verdict, margin and rank of each sensor, as `verdicts.judgement` and `selection`.
function judgeSensors(models, requirement) {
  const judged = Object.create(null);
  const by = requirement.limits.map((limit) => {
    const levers = listLevers(limit, requirement);
    const errors = Object.entries(models.sensors).map(([name, sensor]) =>
      [name, measureErrors(sensor, limit, requirement, levers, requirement.radii)]);
    const usual = {};
    for (const made of [true, false]) {
      const spreads = errors.filter(([name, own]) => models.sensors[name].simulated === made && own.length)
        .map(([, own]) => predictError(own, limit.sigma, null).spread).filter(Boolean);
      const freedom = sum(spreads.map(([, one]) => one));
      usual[made] = freedom < 3 ? null : [sum(spreads.map(([variance, one]) => variance * one)) / freedom, freedom];
    }
    return Object.fromEntries(errors.map(([name, own]) => [name, judgeLimit(own, limit, usual[models.sensors[name].simulated])]));
  });
  for (const [name, sensor] of Object.entries(models.sensors)) {
    const limits = by.map((one) => one[name]);
    const known = limits.filter((one) => one.margin !== null);
    const worst = known.reduce((least, one) => (one.margin < least.margin ? one : least), known[0] ?? limits[0]);
    const unknown = limits.find((one) => one.margin === null);
    const decides = !unknown || worst.verdict === "fails" ? worst : unknown;
    const { excluded, unknown: demanded } = sensor.demands[requirement.name];
    const worded = limits.map((one) => WORST_FIRST.indexOf(one.verdict));
    let verdict = decides.margin === null ? decides.verdict : WORST_FIRST[Math.min(...worded)];
    let conditions = 0;
    if (excluded) verdict = "excluded";
    else if (verdict === "meets_if") conditions = new Set(limits.flatMap((one) => one.assumed)).size + demanded;
    else if (demanded && verdict.endsWith("meets")) [verdict, conditions] = ["meets_if", demanded];
    judged[name] = { ...decides, verdict, conditions, compared: decides.margin !== null && !excluded && !demanded };
  }
  const passes = ({ verdict }) => verdict === "meets" || verdict === "likely_meets";
  const better = (one, other) => (passes(one) !== passes(other) ? passes(one) : one.margins[0] > other.margins[1]);
  for (const own of Object.values(judged)) {
    const others = Object.values(judged).filter((one) => one.compared);
    own.rank = own.compared ? 1 + others.filter((one) => better(one, own)).length : null;
  }
  return judged;
}

// The models are a file that is loaded when the reader opens the form, or a part of a report in one file.
let loadedModels = null;

function loadModels() {
  loadedModels ??= new Promise((found) => {
    const own = document.getElementById("models");
    if (own) return found(JSON.parse(own.textContent, withoutPrototype));
    window.imubenchModels = (models) => found(JSON.parse(JSON.stringify(models), withoutPrototype));
    document.head.append(element("script", { src: document.body.dataset.plotting.replace("plotly.min.js", "models.js") }));
  });
  return loadedModels;
}

// Unit, size of it in SI, and the range of a slider; a range from 0 is linear, any other logarithmic.
const DEGREE = Math.PI / 180;
const ERROR_UNITS = { attitude: ["deg", DEGREE], heading: ["deg", DEGREE], velocity: ["m/s", 1], position: ["m", 1], cross_track: ["m", 1] };
const FIELDS = {
  window: ["Rest before", "s", 1, 1, 1000],
  temperature_change: ["Temperature change", "K", 1, 0, 60],
  turns: ["Turns", "deg", DEGREE, 0, 720],
};

// A slider beside a number; `put` gets the size in SI.
function makeSlider([label, unit, factor, low, high], size, put) {
  const value = Number((size / factor).toPrecision(4));
  const [least, most] = low > 0 ? [Math.min(low, value), Math.max(high, value)] : [low, Math.max(high, value)];
  const typed = element("input", { type: "number", step: "any", value: String(value) });
  typed.min = low > 0 ? "1e-9" : "0";
  const slider = element("input", { type: "range", min: "0", max: "1000", step: "1" });
  slider.setAttribute("aria-label", `${label}, ${unit}`);
  const slide = (one) => (slider.value = String(1000 * (low > 0 ? Math.log(one / least) / Math.log(most / least) : one / most)));
  slide(value);
  slider.addEventListener("input", () => {
    const share = Number(slider.value) / 1000;
    typed.value = String(Number((low > 0 ? least * (most / least) ** share : share * most).toPrecision(3)));
    put(Number(typed.value) * factor);
  });
  typed.addEventListener("input", () => {
    const one = Number(typed.value);
    if (!typed.checkValidity() || typed.value === "") return;
    slide(one);
    put(one * factor);
  });
  return element("div", { className: "slider" }, labelled(`${label} (${unit})`, typed), slider);
}

// [name, rest, temperature change, turns, time and limit of each error] in the address.
const requirementText = ({ name, start, use, limits }) =>
  [name, start.window ?? 0, use.temperature_change, use.turns, ...limits.flatMap((one) => [one.time, one.at_most])]
    .map((one) => (typeof one === "number" ? Number(one.toPrecision(4)) : one)).join("*");

function readRequirement(models, text) {
  const [name, ...sizes] = (text ?? "").split("*");
  const found = models.requirements.find((one) => one.name === name) ?? models.requirements[0];
  const own = structuredClone(found);
  const [window, change, turns, ...limits] = sizes.map(Number);
  if (found.name === name && limits.length === 2 * own.limits.length && sizes.every((one) => Number(one) >= 0) && limits.every((one) => one > 0)) {
    if (own.start.window && window > 0) own.start.window = window;
    Object.assign(own.use, { temperature_change: change, turns });
    own.limits.forEach((one, i) => Object.assign(one, { time: limits[2 * i], at_most: limits[2 * i + 1] }));
  }
  return own;
}

function judgeOwn(models, own) {
  own.limits.forEach((one) => (one.sigma = one.at_most / own.sigmas));
  return judgeSensors(models, own);
}

function startRequirement(main) {
  const fold = main.querySelector("details.yours");
  if (!fold) return;
  fold.hidden = false;
  const [form, said] = [element("form", { className: "sliders" }), element("output")];
  fold.append(form, said);
  const open = async () => {
    const models = await loadModels();
    if (!models?.requirements.length || form.childElementCount) return;
    let own = readRequirement(models, state.get("yours"));
    const show = () => showOwn(main, said, judgeOwn(models, own));
    fold.addEventListener("pinned", show);
    const changed = () => {
      keep("yours", requirementText(own));
      remember("imubench yours", requirementText(own));
      show();
    };
    const fill = () => {
      const select = element("select", {}, ...models.requirements.map(({ name, title }) => new Option(title, name)));
      select.value = own.name;
      select.addEventListener("change", () => {
        own = readRequirement(models, select.value);
        changed();
        fill();
      });
      const sliders = own.limits.flatMap((limit) => {
        const error = limit.error.replace("_", "-");
        const [unit, factor] = ERROR_UNITS[limit.error];
        const size = limit.at_most / factor;
        return [
          makeSlider([`${error[0].toUpperCase()}${error.slice(1)} after`, "s", 1, 1, 3600], limit.time, (one) => (limit.time = one) && changed()),
          makeSlider([`Allowed ${error}`, unit, factor, size / 100, size * 100], limit.at_most, (one) => (limit.at_most = one) && changed()),
        ];
      });
      for (const [name, field] of Object.entries(FIELDS)) {
        const of = name === "window" ? own.start : own.use;
        if (of[name] !== undefined) sliders.push(makeSlider(field, of[name], (one) => ((of[name] = one), changed())));
      }
      form.replaceChildren(labelled("Start from", select), ...sliders);
    };
    fill();
    show();
  };
  fold.addEventListener("toggle", () => fold.open && open());
  if (state.has("yours")) fold.open = true;
}

// Shows the judgements as a column of the figure of margins and of the matrix.
function showOwn(main, said, judged) {
  const [figure, table] = [main.querySelector(".margins"), main.querySelector("[data-decisions]")];
  const [low, high] = JSON.parse(figure.dataset.scale);
  const place = (value) => ((100 * (Math.min(Math.max(Math.log10(value), low), high) - low)) / (high - low)).toFixed(2);
  main.querySelectorAll(".own").forEach((one) => one.remove());
  const put = (into, name, html, className) => {
    const made = element(name, { className: `own ${className}`, innerHTML: html });
    into.append(made);
    return made;
  };
  const [head, ticks] = [figure.querySelector(".heads"), figure.querySelector(".row:last-of-type")];
  put(head, "b", "Yours", "");
  ticks.append(Object.assign(ticks.lastElementChild.cloneNode(true), { className: "ticks own" }));
  put(table.tHead.rows[0], "th", "Yours", "").scope = "col";
  for (const row of figure.querySelectorAll("[data-sensor]")) {
    const { verdict, margin, margins, noise, compared } = judged[row.dataset.sensor] ?? { verdict: "not_enough_data", margin: null };
    const [one, shown] = [place(1), margin !== null && verdict !== "excluded"];
    const at = shown && [margin, ...margins, noise].map(place);
    put(row, "span", `<svg class="bar ${verdict.replaceAll("_", "-")}" width="100%" height="20"><rect class="within" x="${one}%" y="0" width="${100 - one}%" height="20"/><rect class="limit" x="${one}%" y="0" width="1.5" height="20"/>${shown ? `<rect class="cost" x="${Math.min(at[0], at[3])}%" y="9.5" width="${Math.abs(at[3] - at[0])}%" height="1"/><rect class="hollow" x="${at[3]}%" y="6.5" width="7" height="7" transform="translate(-3.5 0)"/><rect x="${at[1]}%" y="8.5" width="${at[2] - at[1]}%" height="3"/><circle cx="${at[0]}%" cy="10" r="5"/>` : ""}</svg>`, "");
  }
  for (const row of table.tBodies[0].rows) {
    const { verdict, margin, margins, noise, conditions, rank } = judged[row.dataset.sensor] ?? { verdict: "not_enough_data", margin: null };
    const named = main.querySelector(`.legend > .${verdict.replaceAll("_", "-")}`);
    const size = margin !== null && verdict !== "excluded" && numberText(margin, Math.min(countDigits(margin, ...margins), 3));
    const words = `<span class="said">${named.querySelector("svg").outerHTML}<b>${named.querySelector("b").textContent}</b>${conditions ? ` <small>${conditions} ${conditions === 1 ? "figure" : "figures"} not known</small>` : ""}</span>`;
    const reference = judged[mine]?.margin;
    const multiple = !(reference > 0) ? "" : row.dataset.sensor === mine ? "mine" : `${numberText(margin / reference, 2)} × mine`;
    put(row, "td", `${words}${size ? ` <span class="size"><span class="value">${size}</span>${multiple && `<span class="mine">${multiple}</span>`}</span> <small class="ranked">noise alone ${numberText(noise, 2)}${rank ? `, rank ${rank}` : ""}</small>` : ""}`, `cell ${verdict.replaceAll("_", "-")}${conditions ? " conditional" : ""}`);
  }
  const first = [...table.tBodies[0].rows].filter((row) => judged[row.dataset.sensor]?.rank === 1);
  const names = first.map((row) => row.cells[0].querySelector("a").textContent).join(", ");
  said.textContent = names ? `Rank 1: ${names}` : "No sensor is ranked.";
}
