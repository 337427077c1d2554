"""The data of the figures of a page: numbers in SI, as JSON."""

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.model.estimates import EnvelopeRow, HistogramRow, ModelSampleRow
from imubench_pipeline.noise import NoiseModel, Term
from imubench_pipeline.report.palette import METHOD_STYLES, Appearance
from imubench_pipeline.report.practical import format_printed
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView
from imubench_pipeline.tables.keys import group_rows

Json = dict[str, Any]
"""Data of a page for its scripts."""

FOREST = (*COMPARED, "B", "T_B")

_SPECTRUM_POINTS = 80  # points of the curve of a term in a spectrum
_COMPARED_MODEL_POINTS = 24  # points of the curve of a model in a comparison of channels
_ABOUT = ("sensor", "recording", "channel", "simulated", "recommended")
_CURVE = ("tau", "adev", "lower", "upper")
"""Properties of a channel, and columns of its curve, that all figures have."""

Packed = tuple[str, float, float, bytes]
"""An array quantised to the visible resolution: kind, begin, step and codes."""


def pack_logarithms(values: ArrayLike) -> Packed:
    """Return positive numbers, shape (n,), packed with a relative error of a few 1e-4."""
    numbers = np.asarray(values, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithms = np.where(numbers > 0.0, np.log10(numbers), np.nan)
    low, step, codes = _quantise(logarithms, 65534)
    # Neighbouring points are close, so their differences compress best, byte by byte.
    differences = codes.astype("<u2")
    differences[1:] -= differences[:-1].copy()
    return "l", low, step, differences.view("<u1").reshape(-1, 2).T.tobytes()


def _quantise(values: NDArray[np.float64], levels: int) -> tuple[float, float, NDArray[np.float64]]:
    """Return start and step of the codes of numbers, and the codes; 0 means no number."""
    finite = np.isfinite(values)
    present = values[finite]
    low, high = (float(present.min()), float(present.max())) if len(present) else (0.0, 0.0)
    step = (high - low) / levels or 1.0
    return low, step, np.where(finite, 1.0 + np.rint((values - low) / step), 0.0)


class Arrays:
    """The arrays of a page, each stored once, as base64 of float32 or of integer codes.

    Code 0 is a missing value (None, NaN); other codes divide the range, or its logarithm, evenly.
    Codes of a logarithm are stored as differences modulo 65536, low bytes before high bytes.
    """

    def __init__(self) -> None:
        self._places: dict[Packed, int] = {}

    def exact(self, values: ArrayLike | Sequence[float | None]) -> int:
        """Store an array as float32; return its index."""
        return self.place(("f", 0.0, 0.0, np.asarray(values, dtype="<f4").tobytes()))

    def log(self, values: ArrayLike) -> int:
        """Store positive numbers with a relative error of a few 1e-4; return their index."""
        return self.place(pack_logarithms(values))

    def even(self, values: ArrayLike | Sequence[float | None]) -> int:
        """Store an array for a linear axis in 254 steps; return its index."""
        low, step, codes = _quantise(np.asarray(values, dtype=np.float64), 254)
        return self.place(("e", low, step, codes.astype("<u1").tobytes()))

    def place(self, packed: Packed) -> int:
        """Store a packed array; return its index."""
        return self._places.setdefault(packed, len(self._places))

    @property
    def texts(self) -> list[list[Any]]:
        """Kind, begin, step and base64 of each array."""
        return [
            [kind, float(f"{low:.12g}"), float(f"{step:.6g}"), base64.b64encode(data).decode()]
            for kind, low, step, data in self._places
        ]


def pack_styles(sensors: Mapping[str, Appearance]) -> Json:
    """Return the appearance of sensors and of all methods, for the scripts of a page."""
    return {
        "sensors": {name: asdict(look) for name, look in sensors.items()},
        "methods": {
            name: asdict(METHOD_STYLES[name]) | {"name": text}
            for name, text in METHOD_NAMES.items()
        },
    }


@dataclass(frozen=True)
class ComparedChannel:
    """The data of a channel that pages compare, small enough to keep all recordings in memory."""

    about: Mapping[str, Any]  # names, recommended method, parameters by method
    curve: Mapping[str, Packed]
    models: Mapping[str, tuple[Packed, Packed]]  # tau and deviation, by method

    def among(self, arrays: Arrays) -> Json:
        """Add the arrays to ``arrays``; return the data with indices in place of arrays."""
        return {
            **self.about,
            **{name: arrays.place(packed) for name, packed in self.curve.items()},
            "models": {
                method: [arrays.place(packed) for packed in curve]
                for method, curve in self.models.items()
            },
        }


def pack_compared_channel(view: ChannelView) -> ComparedChannel:
    """Return the data of a channel in a comparison: curve, models, parameters."""
    models = {}
    for method in view.parameters:
        model, tau = view.model(method), view.tau
        if not model.sinusoids:  # it is smooth
            tau = np.geomspace(tau[0], tau[-1], _COMPARED_MODEL_POINTS)
        models[method] = pack_logarithms(tau), pack_logarithms(_compute_curve(model, tau))
    return ComparedChannel(
        {name: getattr(view, name) for name in _ABOUT}
        | {"parameters": _pack_parameters(view, (view.recommended, "likelihood_gm"))},
        {name: pack_logarithms(getattr(view, name)) for name in _CURVE},
        models,
    )


def _pack_parameters(view: ChannelView, methods: Iterable[str]) -> Json:
    """Return value, limits and status of each component, with the digits of `report.publish`."""
    return {
        method: {
            symbol: [[*map(_round, (r.value, r.lower, r.upper)), r.status] for r in rows]
            for symbol in FOREST
            if (rows := view.named(method, symbol))
        }
        for method in methods
        if method in view.parameters
    }


def _round(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.7g}")


def pack_channel(view: ChannelView, arrays: Arrays) -> Json:
    """Return the data of all figures of a channel, except samples."""
    model = view.model(view.recommended)
    band = ("lower", "upper", "reconstructed")
    terms: list[tuple[str, Term | NoiseModel]] = [*_name_terms(model)]
    if count := len(model.sinusoids):
        name = "line" if count == 1 else f"{count} lines"
        terms.append((name, NoiseModel(sinusoids=model.sinusoids)))
    return {
        **{name: getattr(view, name) for name in _ABOUT},
        **{name: arrays.log(getattr(view, name)) for name in _CURVE},
        "parameters": _pack_parameters(view, (view.recommended,)),
        "methods": {
            method: {
                "tau": arrays.log(curve["tau"]),
                "model": arrays.log(_compute_curve(view.model(method), curve["tau"])),
                **{name: arrays.log(curve[name]) for name in band if method == view.recommended},
            }
            for method, curve in view.reconstruction.items()
        },
        "terms": [
            {"name": name, "adev": arrays.log(_compute_curve(term, view.tau))}
            for name, term in terms
        ],
        "compensated": {name: arrays.log(values) for name, values in view.compensated.items()},
        "datasheet": pack_datasheet_lines(view),
        "spectrum": _pack_spectrum(view, model, arrays) if view.spectrum else None,
    }


def pack_page(channels: Sequence[ChannelView], looks: Mapping[str, Appearance]) -> Json:
    """Return the data of a page with figures of channels; ``looks`` are by sensor."""
    arrays = Arrays()
    return {
        "looks": pack_styles({channel.sensor: looks[channel.sensor] for channel in channels}),
        "channels": [pack_channel(channel, arrays) for channel in channels],
        "arrays": arrays.texts,
    }


def _compute_curve(model: NoiseModel | Term, tau: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(model.allan_variance(tau))


def _name_terms(model: NoiseModel) -> list[tuple[str, Term]]:
    """Return the terms, except spectral lines, with names such as ``white noise N``."""
    return [
        (f"{term.label} {', '.join(term.values)}", term)
        for term in model.terms
        if term not in model.sinusoids
    ]


def pack_datasheet_lines(view: ChannelView) -> list[Json]:
    """Return the datasheet's lines in the Allan plot: value at 1 s, and ``slope``, power of tau."""
    lines = []
    names = {"N": ("noise density", -0.5), "adev_minimum": ("bias instability", 0.0)}
    for row in view.datasheet:
        if row.method != view.recommended or row.comparable is None or row.statistic not in names:
            continue
        name, slope = names[row.statistic]
        reading = f"read as {row.sidedness}" if row.sidedness else ""
        label = f"{name} {format_printed(row)} ({', '.join(filter(None, (row.kind, reading)))})"
        lines.append({"slope": slope, "value": row.comparable, "label": label})
    return lines


def _pack_spectrum(view: ChannelView, model: NoiseModel, arrays: Arrays) -> Json:
    spectrum = view.spectrum
    frequency = spectrum["frequency"]
    smooth = np.geomspace(frequency[0], frequency[-1], _SPECTRUM_POINTS)
    # Fewer points than bins suffice for a line.
    some = np.unique(np.linspace(0, len(frequency) - 1, _SPECTRUM_POINTS).round().astype(int))
    fit = zip(("fitted", "lower", "upper"), (spectrum["fitted"], *view.bin_limits()), strict=True)
    return {
        "frequency": arrays.log(frequency),
        "density": arrays.log(np.sqrt(spectrum["density"])),
        "left": np.flatnonzero(spectrum["used"] == 0).tolist(),
        "fit_frequency": arrays.log(np.take(frequency, some)),
        **{name: arrays.log(np.sqrt(np.take(density, some))) for name, density in fit},
        "model": next((row.model for row in view.models if row.chosen), ""),
        "smooth": arrays.log(smooth),
        "terms": [
            {"name": name, "density": arrays.log(np.sqrt(term.psd(smooth, 1.0 / view.rate)))}
            for name, term in _name_terms(model)
        ],
        "lines": [
            {"frequency": row.frequency, "amplitude": row.amplitude, "kind": row.kind}
            for row in view.lines
        ],
    }


def pack_samples(
    envelope: Sequence[EnvelopeRow], histogram: Sequence[HistogramRow], arrays: Arrays
) -> Json:
    """Return the envelope of the samples of a recording and their histogram, by channel."""
    return {
        "envelope": {
            channel: {"start": rows[0].start, "end": rows[-1].end, **_pack_envelope(rows, arrays)}
            for channel, rows in group_rows(envelope, lambda row: row.channel).items()
        },
        "histogram": {
            channel: {
                "edges": arrays.exact([bins[0].lower, *(row.upper for row in bins)]),
                "count": arrays.log([row.count for row in bins]),
            }
            for channel, bins in group_rows(histogram, lambda row: row.channel).items()
        },
    }


MODEL_SAMPLE_NAMES = {
    "log": "log",
    "before": "model before the fit",
    "after": "model after the fit",
}


def pack_model_samples(rows: Sequence[ModelSampleRow], arrays: Arrays) -> Json:
    """Return the samples of a log and of logs simulated from its models, by channel."""
    drawn: Json = {}
    for channel, of_channel in group_rows(rows, lambda row: row.channel).items():
        drawn[channel] = {}
        for of, name in MODEL_SAMPLE_NAMES.items():
            envelope = [row for row in of_channel if (row.of, row.what) == (of, "envelope")]
            stretch = [row for row in of_channel if (row.of, row.what) == (of, "stretch")]
            if envelope:
                drawn[channel][of] = {
                    "name": name,
                    "end": envelope[-1].end,
                    **_pack_envelope(envelope, arrays),
                    "stretch": arrays.even([row.mean for row in stretch]),
                    "stretch_end": stretch[-1].end,
                }
    return drawn


def _pack_envelope(rows: Sequence[EnvelopeRow | ModelSampleRow], arrays: Arrays) -> dict[str, int]:
    return {n: arrays.even([getattr(row, n) for row in rows]) for n in ("low", "high", "mean")}
