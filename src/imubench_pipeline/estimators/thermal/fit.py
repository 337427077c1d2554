"""Joint estimation of the temperature effect and the noise of a log: sensitivity, lag, bias.

y(t) = bias + s (T_L(t) - T_0) + q (T_L(t) - T_0)^2 + noise, with T_L behind a first-order lag L and
T_0 the mean temperature. Generalised least squares of the effect for given noise, and a Whittle fit
of the noise to the residual, are iterated until they converge.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators import likelihood
from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.frame import FitSelection, select_for_fit
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.missing import average_blocks, split_at_gaps
from imubench_pipeline.estimators.model_choice import Candidate, compare_models
from imubench_pipeline.estimators.spectrum import (
    LineSpectrum,
    Spectrum,
    choose_block_size,
    compute_spectra,
)
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.estimators.thermal.regression import (
    BlockSeries,
    Coefficients,
    Regression,
    Regressors,
)
from imubench_pipeline.estimators.thermal.result import (
    ThermalFit,
    complete_log,
    remove_temperature_effect,
)
from imubench_pipeline.estimators.thermal.uncertainty import (
    Verdict,
    add_likely_walk,
    assess_fit,
    compute_mean_error,
    subtract_path_errors,
    weigh_models,
)
from imubench_pipeline.estimators.whittle import Maximum, Whittle, make_noise_model
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

_MAX_ROUNDS = 10
_TOLERANCE = 0.02
_SETTLING_FRACTIONS = (1 / 64, 1 / 32, 1 / 16)  # durations of settling to try, over the log
_MIN_EXTRA_GAIN = 6.0  # least gain of log likelihood beyond BIC, by the square or by settling
_MIN_TRIAL_GAIN = 2.0
_MAX_ERROR_GROWTH = 2.5  # of s; above it the settling time has most information on s
_MIN_ADDED_ERROR = 0.3  # smallest significant change of a bin, in its standard errors
_MIN_BINS = 24


def fit_temperature(
    blocks: Callable[[], Iterable[Array]],
    samples: int,
    rate: float,
    path: TemperaturePath,
    *,
    holes: bool = False,
    band: float | None = None,
    bandwidth: float | None = None,
    resolution: float = 0.0,
    quadratic: bool | None = None,
    longest_lag: float | None = None,
    plain: Likelihood | None = None,
    rng: np.random.Generator,
) -> ThermalFit:
    """Estimate the temperature effect of a channel together with its noise.

    ``blocks`` returns the log in order, in SI, at each call, NaN where a sample is missing;
    ``path`` is its temperature, in the same segments. With ``holes``, samples may be missing;
    ``band``, ``bandwidth`` and ``resolution`` are as in `likelihood.fit`. The square of the
    temperature is in the model by ``quadratic``, or if BIC favours it. ``longest_lag``, s, is a
    twentieth of the longest segment by default, at most half an hour; 0: no lag. ``plain`` is the
    noise without compensation, if known. Raises ValueError below 16 samples.

    References
    ----------
    A. C. Aitken, Proc. R. Soc. Edinburgh 55, 1935 (generalised least squares); H. D. Patterson and
    R. Thompson, Biometrika 58, 1971 (restricted likelihood).
    """
    spans = path.segments
    find_frame = partial(select_for_fit, band=band, bandwidth=bandwidth, resolution=resolution)

    def frame(spectrum: Spectrum, lines: list[LineSpectrum]) -> FitSelection:
        if plain is not None and len(plain.frame.used) == len(spectrum.frequency):
            return plain.frame
        return find_frame(spectrum, lines)

    varies = path.range > 0.0 and path.range >= 2.0 * float(np.median(path.deviation))
    if holes:
        means = average_blocks(blocks(), spans)
        spans = split_at_gaps(means, spans)
        plain = plain or likelihood.fit_blocks(
            blocks,
            samples,
            rate,
            holes=True,
            segments=path.segments,
            band=band,
            bandwidth=bandwidth,
            resolution=resolution,
            rng=rng,
        )
        model, effect = plain.estimates[0].model, np.zeros(len(path.value))
        for _ in range(2):
            log = complete_log(blocks, spans, model, path, effect, rate, rng)
            fit = _Fit(log, samples, rate, spans, path, frame, longest_lag)
            if not (fit.possible and varies):
                break
            settled = fit.settle(quadratic)
            model = make_noise_model(settled.noise)
            effect = settled.regressors.effect(settled.regression)
    else:
        fit = _Fit(blocks(), samples, rate, spans, path, frame, longest_lag)
        plain = plain or likelihood.fit_spectrum(fit.spectrum, fit.frame, rng=rng)
    if not fit.possible:
        return _nothing(plain, path, fit, texts.SHORT_LOG)
    if not varies:
        return _nothing(plain, path, fit, texts.small_temperature_range(path.range))
    settled = fit.settle(quadratic)
    verdict = fit.judged(settled, rng)
    if not verdict.compensated and len(fit.lags) > 1:
        # Without an effect, the fitted lag only makes a random walk look like temperature.
        fit.lags = fit.lags[:1]
        settled = fit.settle(quadratic)
        verdict = replace(fit.judged(settled, rng), lag=verdict.lag)

    def spectra_left() -> tuple[Spectrum, list[LineSpectrum]]:
        effect, log = settled.regressors.effect(settled.regression), blocks()
        if holes:
            left = make_noise_model(settled.noise)
            log = complete_log(blocks, spans, left, path, effect, rate, rng)
        return compute_spectra(remove_temperature_effect(log, path, effect), samples, rate, spans)

    lines = fit.lines
    if verdict.compensated:
        left, lines = spectra_left()
        if fit.take_fast(left):
            settled = fit.settle(quadratic)
            verdict = replace(fit.judged(settled, rng), compensated=True, reason=verdict.reason)
            left, lines = spectra_left()
            fit.take_fast(left)
    return _described(fit, settled, verdict, plain, path, lines, find_frame, rng)


@dataclass(frozen=True)
class _Settled:
    """A converged fit."""

    regressors: Regressors
    regression: Regression
    whittle: Whittle
    candidates: Sequence[Candidate]
    cost: float

    @property
    def noise(self) -> Maximum:
        """The best noise model of the residual."""
        return self.candidates[0].maximum


class _Fit:
    """The spectrum of a complete log, and its products with the temperature."""

    def __init__(
        self,
        blocks: Iterable[Array],
        samples: int,
        rate: float,
        spans: Sequence[Span],
        path: TemperaturePath,
        frame: Callable[[Spectrum, list[LineSpectrum]], FitSelection],
        longest_lag: float | None,
    ) -> None:
        series = BlockSeries(spans, choose_block_size(spans))
        self.spectrum: Spectrum
        self.lines: list[LineSpectrum]
        self.spectrum, self.lines = compute_spectra(series.watch(blocks), samples, rate, spans)
        self.series = series
        self.frame = frame(self.spectrum, self.lines)
        self.used = self.frame.used
        self.possible = bool(self.used.sum() >= _MIN_BINS)
        if not self.possible:
            return
        self.chosen = self.spectrum.select(self.used)
        self.whittle = self.frame.whittle(self.spectrum)
        self.quantization = self.frame.shows_quantization(rate)
        self.regressors = Regressors(
            Coefficients(self.spectrum, series), path, rate, path.mean, self.used
        )
        self.lags = self.regressors.lags(longest_lag)

    def take_fast(self, left: Spectrum) -> bool:
        """Take over the high frequencies of the residual; return whether they changed.

        The products with temperature are known at low frequencies only (`Coefficients`), and a
        temperature that jumps has high frequencies too.
        """
        fast = self.spectrum.block != self.series.block
        before, after = self.spectrum.density[fast], left.density[fast]
        moved = np.abs(after / before - 1.0) * np.sqrt(self.spectrum.ordinates[fast])
        if not (moved > _MIN_ADDED_ERROR).any():
            return False
        density = self.spectrum.density.copy()
        density[fast] = after
        self.spectrum = replace(self.spectrum, density=density)
        self.chosen = self.spectrum.select(self.used)
        self.whittle = self.whittle.of(self.chosen)
        vars(self).pop("of_the_log", None)
        return True

    def settle(self, quadratic: bool | None) -> _Settled:
        """Return the joint fit; add a quadratic term, or a separate initial sensitivity, if needed.

        The square is tried if ``quadratic`` is None.
        """
        needed = 0.5 * math.log(len(self.chosen.density)) + _MIN_TRIAL_GAIN
        settled = self._best(self.regressors.also(quadratic=bool(quadratic)))
        duration = self.spectrum.duration
        for _ in range(2):
            extended = [
                settled.regressors.also(settling=part * duration) for part in _SETTLING_FRACTIONS
            ]
            extended = [] if settled.regressors.settling else extended
            if quadratic is None and not settled.regressors.quadratic:
                extended.append(settled.regressors.also(quadratic=True))
            density = settled.whittle.density(settled.noise)
            weights, lag = self.chosen.ordinates / density, settled.regression.lag
            gains = [
                regressors.at(lag, weights).log_likelihood_gain
                - settled.regression.log_likelihood_gain
                for regressors in extended
            ]
            if not gains or max(gains) < needed:
                break
            wider = self._best(extended[int(np.argmax(gains))])
            if (
                wider.cost > settled.cost - _MIN_EXTRA_GAIN
                or wider.regression.error > _MAX_ERROR_GROWTH * settled.regression.error
            ):
                break
            settled = wider
        return settled

    def _best(self, regressors: Regressors) -> _Settled:
        """Settle from the noise without compensation, and from the noise after least squares."""
        flat = self.chosen.ordinates
        rough = regressors.at(0.0, flat)
        left = self.whittle.of(regressors.without(self.chosen, rough, flat))
        starts = (
            self._weights(self.whittle, self.of_the_log),
            self._weights(left, self._compared(left)),
        )
        return min((self._settle(regressors, start) for start in starts), key=lambda f: f.cost)

    def _compared(self, whittle: Whittle) -> Sequence[Candidate]:
        return compare_models(whittle, quantization=self.quantization)

    def _weights(self, whittle: Whittle, candidates: Sequence[Candidate]) -> Array:
        return self.chosen.ordinates / whittle.density(candidates[0].maximum)

    def _settle(self, regressors: Regressors, weights: Array) -> _Settled:
        before: Regression | None = None
        for _ in range(_MAX_ROUNDS):
            regression = regressors.best(weights, self.lags)
            left = regressors.without(self.chosen, regression, weights)
            whittle = self.whittle.of(left)
            candidates = self._compared(whittle)
            weights = self._weights(whittle, candidates)
            ramp = candidates[0].terms.ramp
            if ramp != regressors.ramp:
                regressors = regressors.also(ramp=ramp)
                before = None
                continue
            if before is not None:
                moved = abs(regression.beta[0] - before.beta[0])
                if moved < _TOLERANCE * regression.error:
                    break
            before = regression
        free = candidates[0].terms.parameters + len(regression.beta) - ramp + (regression.lag > 0.0)
        return _Settled(
            regressors, regression, whittle, candidates, self._cost(whittle, candidates, free)
        )

    def _cost(self, whittle: Whittle, candidates: Sequence[Candidate], free: int) -> float:
        """Return half the BIC, with the ordinates of the log and ``free`` parameters."""
        maximum, ordinates = candidates[0].maximum, self.chosen.ordinates
        density = whittle.density(maximum)
        data = whittle.data(maximum) * whittle.spectrum.ordinates / ordinates
        cost = 0.5 * float(np.sum(ordinates * (np.log(density) + data / density)))
        return cost + 0.5 * free * math.log(len(density))

    def judged(self, settled: _Settled, rng: np.random.Generator) -> Verdict:
        """Return the verdict on a converged fit."""
        terms = self.of_the_log[0].terms
        plain = self._cost(self.whittle, self.of_the_log, terms.parameters)
        fitted = settled.regressors, settled.regression, settled.whittle, settled.candidates
        return assess_fit(*fitted, self.lags, gained=2.0 * (plain - settled.cost), rng=rng)

    @cached_property
    def of_the_log(self) -> Sequence[Candidate]:
        """The models of the noise without temperature, the best first."""
        return self._compared(self.whittle)


def _described(
    fit: _Fit,
    settled: _Settled,
    verdict: Verdict,
    plain: Likelihood,
    path: TemperaturePath,
    lines: list[LineSpectrum],
    find_frame: Callable[[Spectrum, list[LineSpectrum]], FitSelection],
    rng: np.random.Generator,
) -> ThermalFit:
    """Return the result, with the noise and the ``lines`` of the residual."""
    without, effect = plain, np.zeros(len(path.value))
    mean = fit.spectrum.mean
    if verdict.compensated:
        regressors = settled.regressors.also(used=np.ones(len(fit.used), dtype=np.bool_))
        weights = np.zeros(len(fit.used))
        best = settled.noise
        weights[fit.used] = fit.chosen.ordinates / settled.whittle.density(best)
        left = regressors.without(fit.spectrum, settled.regression, weights)
        left = subtract_path_errors(
            left, fit.used, settled.whittle, best.terms, verdict.path_errors
        )
        effect = regressors.effect(settled.regression)
        without = likelihood.fit_spectrum(left, find_frame(left, lines), rng=rng)
    added = [path.means(*place, effect) for place in fit.series.places]
    shift = float(np.concatenate(added).mean())
    candidates = settled.candidates if verdict.compensated else fit.of_the_log
    # The error of T_0 is the error of the mean of the path.
    of_reference = float(np.std(path.draws.mean(axis=1))) * (verdict.sensitivity.in_model or 0.0)
    spread = math.hypot(
        _mean_error(candidates, without, fit.spectrum),
        verdict.temperature_error,
        of_reference if verdict.compensated else 0.0,
    )
    bias = Parameter(
        mean - shift, lower=mean - shift - SIGMAS * spread, upper=mean - shift + SIGMAS * spread
    )
    described = verdict.sensitivity, verdict.quadratic, verdict.lag, bias, verdict.compensated
    return ThermalFit(path.mean, *described, verdict.reason, plain, without, effect, path)


def _mean_error(candidates: Sequence[Candidate], fitted: Likelihood, spectrum: Spectrum) -> float:
    """Return the standard deviation of the mean of a log, averaged over its noise models."""
    (estimate, _), K = fitted.estimates, fitted.estimates[0].parameters["K"]
    noises = [
        (add_likely_walk(model, K) if "K" in candidate.terms.linear else model, share)
        for candidate, share in (weigh_models(candidates) if candidates else [])
        for model in [make_noise_model(candidate.maximum)]
    ]
    return compute_mean_error(noises or [(estimate.model, 1.0)], spectrum)


def _nothing(plain: Likelihood, path: TemperaturePath, fit: _Fit, reason: str) -> ThermalFit:
    unknown = Parameter(None, "not_identified", reason)
    mean, spread = fit.spectrum.mean, _mean_error(plain.candidates, plain, fit.spectrum)
    bias = Parameter(mean, lower=mean - SIGMAS * spread, upper=mean + SIGMAS * spread)
    described, effect = (unknown, unknown, unknown, bias, False), np.zeros(len(path.value))
    return ThermalFit(path.mean, *described, reason, plain, plain, effect, path)
