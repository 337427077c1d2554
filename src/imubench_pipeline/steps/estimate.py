"""The estimates of one channel by every method, as rows of the tables."""

import json
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

import numpy as np

from imubench_pipeline.allan import AllanCurve, of_blocks
from imubench_pipeline.allan.phase import NO_GAPS, count_presence
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators import least_squares, likelihood, rows
from imubench_pipeline.estimators.agreement import doubt_contradicted, yield_disagreements
from imubench_pipeline.estimators.curve_limits import add_fitted_limits
from imubench_pipeline.estimators.deterministic.courses import find_deterministic_signals
from imubench_pipeline.estimators.deterministic.verdict import (
    assess_signals,
    state_effects,
    tabulate_signals,
)
from imubench_pipeline.estimators.estimate import (
    PARAMETERS,
    SI_UNITS,
    Estimate,
    Parameter,
    not_shown,
)
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.estimators.lines import select_sinusoids
from imubench_pipeline.estimators.robust import fit as robust
from imubench_pipeline.estimators.robust.parts import compute_part_variances
from imubench_pipeline.estimators.spectral_findings import (
    find_missing_slow_noise,
    spectral_findings,
    withhold_slow_noise,
)
from imubench_pipeline.estimators.thermal.fit import (
    ThermalFit,
    add_temperature_effect,
    fit_temperature,
)
from imubench_pipeline.estimators.thermal.path import (
    TemperaturePath,
    estimate_resolution,
    estimate_temperature_path,
)
from imubench_pipeline.model import estimates as model
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.noise import Sinusoid
from imubench_pipeline.noise.simulate import channel_rng
from imubench_pipeline.recordings.kept import load_static_logs
from imubench_pipeline.recordings.recording import ChannelLog, average_blocks
from imubench_pipeline.settings.config import EstimateSettings
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.steps.allan import read_curves, report_too_sparse
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array
from imubench_pipeline.units import parse_quantity
from imubench_pipeline.words.numbers import sentence
from imubench_pipeline.words.reasons import simulations as texts


@dataclass
class Estimation:
    """Estimates of a recording, as rows of each table that the step writes."""

    allan: list[model.AllanRow] = field(default_factory=list)
    parameters: list[model.ParameterRow] = field(default_factory=list)
    draws: list[model.DrawRow] = field(default_factory=list)
    models: list[model.ModelRow] = field(default_factory=list)
    lines: list[model.LineRow] = field(default_factory=list)
    spectrum: list[model.SpectrumRow] = field(default_factory=list)
    fixed_bias: list[model.FixedBiasRow] = field(default_factory=list)
    temperature: list[model.TemperatureRow] = field(default_factory=list)
    allan_compensated: list[model.CompensatedAllanRow] = field(default_factory=list)
    low_pass: list[model.LowPassRow] = field(default_factory=list)
    deterministic: list[model.DeterministicRow] = field(default_factory=list)
    estimate_findings: list[FindingRow] = field(default_factory=list)
    estimates: dict[str, dict[str, Estimate]] = field(default_factory=dict)
    """By channel and method: the estimates in the tables ``parameters`` and ``draws``."""
    paths: dict[Path, TemperaturePath] = field(default_factory=dict)
    """Estimated temperature of each log file, which all channels of the file share."""

    def add_findings(self, key: Key, findings: Iterable[Finding]) -> None:
        """Add rows for the findings on a channel."""
        self.estimate_findings += [finding.row(key.sensor, key.recording) for finding in findings]


def estimate_channel(
    key: Key,
    log: ChannelLog,
    curve: AllanCurve,
    settings: EstimateSettings,
    bandwidth: float | None,
    into: Estimation,
) -> None:
    """Estimate the noise of a channel by every method of the settings; add the rows to `into`.

    `curve`: Allan variance of the log; `bandwidth`: stated cut-off of the sensor, Hz, or None.
    """
    channel = _Channel(key, log, curve, settings, bandwidth)
    verdict = assess_signals(key.channel, channel.signals, has_temperature=bool(log.temperature))
    into.deterministic += tabulate_signals(asdict(key), channel.unit, channel.signals)
    estimates = channel.by_curve()
    if _LIKELIHOOD_METHODS & set(settings.methods):
        estimates |= channel.by_likelihood(into)
    else:
        into.allan += rows.make_allan_rows(key, curve)
    into.add_findings(key, channel.state_effects(verdict.findings, estimates.get("robust")))
    into.add_findings(key, yield_disagreements(key.channel, estimates))
    best = next(method for method in _METHODS_BY_PREFERENCE if method in settings.methods)
    reference = estimates.get("robust", estimates.get("likelihood"))
    if reference is not None:
        estimates |= {
            method: doubt_contradicted(estimates[method], reference)
            for method in _CURVE_METHODS
            if method in estimates
        }
    for method in settings.methods:
        if method in estimates:
            estimate = estimates[method]
            if method != "compensated":
                estimate = verdict.apply(estimate)
            into.estimates.setdefault(key.channel, {})[method] = estimate
            into.parameters += rows.make_parameter_rows(key, estimate, recommended=method == best)
            into.draws += rows.make_draw_rows(key, estimate)
    if channel.fitted is not None:
        recommended = into.estimates[key.channel].get(best)
        N = recommended.parameters["N"].value if recommended else None
        into.add_findings(key, spectral_findings(key.channel, channel.fitted.frame, N))
    into.fixed_bias.append(model.FixedBiasRow(**asdict(key), value=channel.mean, unit=channel.unit))


class _Channel:
    """A channel, with the deterministic signals that are removed before the estimation."""

    def __init__(
        self,
        key: Key,
        log: ChannelLog,
        curve: AllanCurve,
        settings: EstimateSettings,
        bandwidth: float | None,
    ) -> None:
        self.key, self.log, self.curve = key, log, curve
        self.settings = settings
        self.unit = SI_UNITS[quantity_of(key.channel)]["B"]
        self.mean = log.mean()
        self._bandwidth = bandwidth
        self._band = parse_quantity(settings.band, "frequency") if settings.band else None
        limits = [limit for limit in (self._band, 0.5 * (bandwidth or 0.0)) if limit]
        # The noise is not attenuated up to this frequency.
        self._unfiltered = min(limits, default=None)
        self.signals = find_deterministic_signals(
            log.blocks, log.grid, log.rate, segments=log.segments, highest=self._unfiltered
        )
        self._presence = count_presence(log.blocks(), log.grid, log.segments) if log.holes else None
        self._bare = self._curve_of(self._blocks()) if self.signals.signals else curve
        self.fitted: Likelihood | None = None

    def by_curve(self) -> dict[str, Estimate]:
        """Return the estimates that are read from the Allan variance, or fitted to it."""
        settings, curve, longest = self.settings, self._bare, self.settings.longest
        estimates: dict[str, Estimate] = {}
        if "curve" in settings.methods:
            estimates["curve"] = reading.read(curve, longest=longest)
        for method in ("paper", "weighted"):
            if method in settings.methods:
                try:
                    estimates[method] = least_squares.fit(curve, method=method, longest=longest)
                except least_squares.UnfitCurveError as error:
                    estimates[method] = not_shown(method, str(error))
        return estimates

    def by_likelihood(self, into: Estimation) -> dict[str, Estimate]:
        """Return the estimates from the spectrum; add the rows of their tables to `into`."""
        key, log = self.key, self.log
        self.fitted = fitted = self._fitted(self._blocks, self._bare)
        estimates = {estimate.method: estimate for estimate in fitted.estimates}
        if "robust" in self.settings.methods:
            estimates["robust"] = self._fit_robustly(self._blocks, self._bare, fitted)
        compensating = log.temperature and "compensated" in self.settings.methods
        warm = self._fit_temperature(into) if compensating else None
        if warm is not None and warm.compensated:

            def rest() -> Iterator[Array]:
                return warm.compensate(log.blocks())

            left = self._curve_of(rest())
            without = self._fitted(rest, left)
            nothing = (np.zeros(len(values)) for values in log.blocks())
            added = self._curve_of(
                add_temperature_effect(nothing, warm.path, warm.effect), whole=True
            )
            best = without.estimates[0]
            if "robust" in self.settings.methods:
                # The fitted effect also contains some of the noise.
                taken = warm.relative_error**2 * added.variance
                whole = replace(left, variance=left.variance + taken)
                best = self._fit_robustly(rest, whole, without)
            estimates["compensated"] = replace(best, method="compensated")

        limited = partial(add_fitted_limits, segments=log.segments, presence=self._presence)
        into.allan += rows.make_allan_rows(key, limited(self.curve, fitted))
        if not self.signals.signals:  # removing these also removes slow noise
            white = fitted.estimates[0].parameters["N"].lower
            lack = find_missing_slow_noise(key.channel, fitted.spectrum, fitted.fitted, white)
            if lack is not None:
                into.add_findings(key, [lack])
                estimates = {name: withhold_slow_noise(one) for name, one in estimates.items()}
        into.models += _model_rows(key, fitted)
        into.lines += (model.LineRow.taken_from(line, **asdict(key)) for line in fitted.lines)
        into.spectrum += _spectrum_rows(key, fitted)
        into.low_pass += _low_pass_rows(key, fitted)
        if warm is not None:
            into.temperature += _temperature_rows(key, warm)
            if warm.compensated:
                into.allan_compensated += rows.make_curve_rows(
                    model.CompensatedAllanRow,
                    key,
                    limited(left, without),
                    temperature=added.deviation,
                )
        return estimates

    def state_effects(
        self, findings: Sequence[Finding], estimate: Estimate | None
    ) -> Sequence[Finding]:
        """Return findings, with the change that removing the signals makes to the parameters."""
        if estimate is None or self.fitted is None or not self.signals.signals:
            return findings
        try:
            without = robust.fit_values(self.curve, self._noise_lines(self.fitted))
        except least_squares.UnfitCurveError:
            return findings
        return state_effects(findings, estimate, without, self.mean)

    def _noise_lines(self, fitted: Likelihood) -> list[Sinusoid]:
        return [line.term for line in fitted.lines if line.kind != "alias"]

    def _fit_robustly(
        self, blocks: Callable[[], Iterator[Array]], curve: AllanCurve, fitted: Likelihood
    ) -> Estimate:
        """Return the estimate from the curve and its parts; the lines are of the spectrum."""
        log, there = self.log, self._presence
        parts = compute_part_variances(
            blocks(),
            curve,
            holes=there is not None,
            gaps=there.gaps if there else NO_GAPS,
            segments=log.segments,
        )
        try:
            estimate = robust.fit(
                curve, parts, self._noise_lines(fitted), rng=self._stream("robust")
            )
        except least_squares.UnfitCurveError as error:
            return not_shown("robust", str(error))
        return replace(estimate, lines=select_sinusoids(fitted.lines))

    def _curve_of(self, blocks: Iterator[Array], *, whole: bool = False) -> AllanCurve:
        """Return the Allan variance of the log without deterministic signals, at equal clusters."""
        log, sizes = self.log, self.curve.cluster_size
        there = None if whole else self._presence
        return of_blocks(
            blocks,
            log.grid,
            log.rate,
            sizes,
            holes=there is not None,
            gaps=there.gaps if there else NO_GAPS,
            segments=log.segments,
        )

    def _fit_temperature(self, into: Estimation) -> ThermalFit:
        """Return the temperature effect; a warm-up, which it explains, remains in the log."""
        log = self.log
        if log.path not in into.paths:
            of_clock = f"{log.path.name} {average_blocks(log.temperatures())!r}"
            rng = channel_rng(self.settings.seed, of_clock, "temperature")
            into.paths[log.path] = estimate_temperature_path(log.temperatures(), log.segments, rng)
        return fit_temperature(
            log.blocks(), log.grid, log.rate, into.paths[log.path], highest=self._unfiltered
        )

    def _fitted(self, blocks: Callable[[], Iterator[Array]], curve: AllanCurve) -> Likelihood:
        log = self.log
        return likelihood.fit_blocks(
            blocks,
            samples=log.grid,
            rate=log.rate,
            holes=log.holes,
            segments=log.segments,
            band=self._band,
            bandwidth=self._bandwidth,
            resolution=estimate_register_step(log),
            rng=self._stream("posterior"),
        )

    def _blocks(self) -> Iterator[Array]:
        return self.signals.subtract_from(self.log.blocks())

    def _stream(self, use: str) -> np.random.Generator:
        """Return a random stream that depends only on the samples, not on file names."""
        return channel_rng(self.settings.seed, f"{self.mean!r}", f"{self.log.grid}", use)


_MIN_SAMPLES_FOR_STEP = 1 << 16  # samples from which the step of a register is found
_LIKELIHOOD_METHODS = {"robust", "likelihood", "likelihood_gm", "compensated"}

_CURVE_METHODS = ("likelihood_gm", "weighted", "paper", "curve")  # of one model, or of the curve
_METHODS_BY_PREFERENCE = ("robust", "likelihood", "likelihood_gm", "weighted", "paper", "curve")
"""Methods in order of preference: the first requested one is recommended."""


def _model_rows(key: Key, fit: Likelihood) -> Iterator[model.ModelRow]:
    for place, candidate in enumerate(fit.candidates):
        yield model.ModelRow(
            **asdict(key),
            model=candidate.terms.name,
            chosen=place == 0,
            free=candidate.terms.parameters,
            log_likelihood=-candidate.maximum.cost,
            bic=candidate.bic,
            aic=candidate.aic,
            weight=candidate.weight,
            deviance=candidate.goodness.deviance,
            chance=candidate.goodness.chance,
            verdict=candidate.goodness.verdict,
            note=sentence(candidate.goodness.where),
            bins=int(fit.used.sum()),
            band=fit.band.highest if fit.band else None,
            band_source=fit.frame.band_words if fit.band else None,
        )


def _spectrum_rows(key: Key, fit: Likelihood) -> Iterator[model.SpectrumRow]:
    spectrum, fitted = fit.spectrum, fit.fitted
    for i, frequency in enumerate(spectrum.frequency):
        yield model.SpectrumRow(
            **asdict(key),
            frequency=float(frequency),
            lower=float(spectrum.lower[i]),
            upper=float(spectrum.upper[i]),
            ordinates=float(spectrum.ordinates[i]),
            density=float(spectrum.density[i]),
            fitted=float(fitted[i]) if np.isfinite(fitted[i]) else None,
            used=bool(fit.used[i]),
        )


def _temperature_rows(key: Key, fit: ThermalFit) -> Iterator[model.TemperatureRow]:
    unit = SI_UNITS[quantity_of(key.channel)]["B"]
    reason = fit.sensitivity.reason or fit.reason
    figures = {
        "T_0": (Parameter(fit.reference), "degC"),
        "sensitivity": (replace(fit.sensitivity, reason=reason), f"{unit}/K"),
        "quadratic": (fit.quadratic, f"{unit}/K^2"),
        "lag": (fit.lag, "s"),
        "bias": (fit.bias, unit),
    }
    for name, (parameter, its_unit) in figures.items():
        more = {"compensated": fit.compensated, "parameter": name, "unit": its_unit}
        yield model.TemperatureRow.taken_from(parameter, **asdict(key), **more)


def _low_pass_rows(key: Key, fit: Likelihood) -> Iterator[model.LowPassRow]:
    low_pass = fit.frame.low_pass
    if low_pass is None:
        return
    density = SI_UNITS[quantity_of(key.channel)]["N"]
    figures = {"cutoff": (low_pass.frequency, "Hz")}
    if low_pass.order is not None:
        figures["floor"] = (Parameter(low_pass.floor), density)
    for name, (parameter, unit) in figures.items():
        filter_ = {"kind": low_pass.kind, "order": low_pass.order}
        more = {**asdict(key), **filter_, "parameter": name, "unit": unit}
        yield model.LowPassRow.taken_from(parameter, **more)


def estimate_register_step(log: ChannelLog) -> float:
    """Return the quantisation step at the beginning of a log, SI; 0 if none is visible."""
    values = next((block for block in log.blocks() if np.isfinite(block).any()), np.empty(0))
    present = values[np.isfinite(values)][:_MIN_SAMPLES_FOR_STEP]
    return estimate_resolution(np.unique(present), len(present))


def estimate_recording(
    folder: Path, sensor: str, recording: str, settings: str, channels: Container[str] | None = None
) -> Estimation:
    """Return the rows of ``channels`` (None: all) of a recording; none if it was rejected."""
    sections = json.loads(settings)
    into = Estimation()
    logs = load_static_logs(folder)
    grids = {channel: log.grid for channel, log in logs.items()}
    measured = read_curves(folder / "curve.parquet", grids)
    for channel, log in logs.items():
        if channels is not None and channel not in channels:
            continue
        key = Key(sensor, recording, channel)
        if channel not in measured:
            into.add_findings(key, [report_too_sparse(channel, log)])
            continue
        how = EstimateSettings.model_validate(sections["estimate"])
        estimate_channel(key, log, measured[channel], how, sections["bandwidth"], into)
        if read := sections.get("authors", {}).get(channel):
            # The authors read their own log; they do not print every parameter.
            unread = Parameter(None, "not_shown", texts.NOT_PRINTED_BY_SOURCE)
            figures = {
                name: Parameter(read[name]) if name in read else unread for name in PARAMETERS
            }
            estimate = Estimate("authors", figures)
            into.parameters += rows.make_parameter_rows(key, estimate, recommended=False)
    return into
