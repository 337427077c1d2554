"""The data of the figures of a page: numbers in SI, as JSON."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.model.estimates import EnvelopeRow, HistogramRow
from imubench_pipeline.model.table import ChannelRow
from imubench_pipeline.noise import NoiseModel, Term
from imubench_pipeline.report.palette import Appearance, method_appearance
from imubench_pipeline.report.practical import printed_text
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView

FOREST = (*COMPARED, "B", "T_B")
"""The parameters that are drawn across sensors."""

_SPECTRUM_POINTS = 80
"""Points of the curve of a term in a spectrum."""

_COMPARED_MODEL_POINTS = 24
"""Points of the curve of a model in a comparison of channels."""


Packed = tuple[str, float, float, bytes]
"""An array quantised to the visible resolution: kind, begin, step and codes."""


def packed_log(values: ArrayLike) -> Packed:
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
    """Return begin and step of the codes of numbers, and the codes; 0 stands for none."""
    finite = np.isfinite(values)
    if finite.all():
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 0.0)
        step = (high - low) / levels or 1.0
        return low, step, 1.0 + np.rint((values - low) / step)
    present = values[finite]
    low, high = (float(present.min()), float(present.max())) if len(present) else (0.0, 0.0)
    step = (high - low) / levels or 1.0
    return low, step, np.where(finite, 1.0 + np.rint((values - low) / step), 0.0)


class Arrays:
    """Arrays of a page: each is stored once, as base64 of its codes.

    ``levels``: 0 stands for no value, the others divide the range evenly, or its logarithm. Those
    of a logarithm are kept as differences modulo 65536, all low bytes before all high ones.
    """

    def __init__(self) -> None:
        self._places: dict[Packed, int] = {}

    def exact(self, values: ArrayLike) -> int:
        """Return the place of an array that is kept as float32."""
        return self.place(("f", 0.0, 0.0, np.asarray(values, dtype="<f4").tobytes()))

    def log(self, values: ArrayLike) -> int:
        """Return the place of an array of positive numbers with a relative error of a few 1e-4."""
        return self.place(packed_log(values))

    def even(self, values: ArrayLike) -> int:
        """Return the place of an array that is drawn on an even axis, in 254 steps."""
        low, step, codes = _quantise(np.asarray(values, dtype=np.float64), 254)
        return self.place(("e", low, step, codes.astype("<u1").tobytes()))

    def place(self, packed: Packed) -> int:
        """Return the place of an array that is packed."""
        return self._places.setdefault(packed, len(self._places))

    @property
    def texts(self) -> list[list[Any]]:
        """Kind, begin, step and base64 of each array."""
        return [
            [kind, float(f"{low:.12g}"), float(f"{step:.6g}"), base64.b64encode(data).decode()]
            for kind, low, step, data in self._places
        ]


def looks(sensors: Mapping[str, Appearance]) -> dict[str, Any]:
    """Return the appearance of sensors and methods."""
    return {
        "sensors": {name: asdict(look) for name, look in sensors.items()},
        "methods": {
            name: asdict(method_appearance(name)) | {"name": text}
            for name, text in METHOD_NAMES.items()
        },
    }


@dataclass(frozen=True)
class ComparedChannel:
    """The data of a channel in a comparison, small enough to keep those of all recordings."""

    about: Mapping[str, Any]  # names, recommended method, parameters by method
    curve: Mapping[str, Packed]
    models: Mapping[str, tuple[Packed, Packed]]  # tau and deviation, by method

    def among(self, arrays: Arrays) -> dict[str, Any]:
        """Return it with the places of its arrays in those of a page."""
        return {
            **self.about,
            **{name: arrays.place(packed) for name, packed in self.curve.items()},
            "models": {
                method: [arrays.place(packed) for packed in curve]
                for method, curve in self.models.items()
            },
        }


def compared(view: ChannelView) -> ComparedChannel:
    """Return the data of a channel in a comparison: curve, models, parameters."""
    return ComparedChannel(
        about={
            "sensor": view.sensor,
            "recording": view.recording,
            "channel": view.channel,
            "simulated": view.simulated,
            "recommended": view.recommended,
            "parameters": {
                method: _list_estimates(view, method)
                for method in dict.fromkeys((view.recommended, "likelihood_gm"))
                if method in view.parameters
            },
        },
        curve={
            "tau": packed_log(view.tau),
            "adev": packed_log(view.adev),
            "lower": packed_log(view.lower),
            "upper": packed_log(view.upper),
        },
        models={method: _pack_model(view.model(method), view.tau) for method in view.parameters},
    )


def _pack_model(model: NoiseModel, tau: NDArray[np.float64]) -> tuple[Packed, Packed]:
    """Return the curve of a model, on few points where it is smooth."""
    if not model.sinusoids:
        tau = np.geomspace(tau[0], tau[-1], _COMPARED_MODEL_POINTS)
    return packed_log(tau), packed_log(_compute_curve(model, tau))


def channel_payload(view: ChannelView, rate: float | None, arrays: Arrays) -> dict[str, Any]:
    """Return the data of all figures of a channel, except samples; ``rate`` is in Hz."""
    model = view.model(view.recommended)
    return {
        "channel": view.channel,
        "sensor": view.sensor,
        "recording": view.recording,
        "simulated": view.simulated,
        "recommended": view.recommended,
        "tau": arrays.log(view.tau),
        "adev": arrays.log(view.adev),
        "lower": arrays.log(view.lower),
        "upper": arrays.log(view.upper),
        "methods": {
            method: _pack_method(view, method, curve, arrays)
            for method, curve in view.reconstruction.items()
        },
        "terms": [
            {
                "name": name,
                "adev": arrays.log(np.sqrt(term.allan_variance(view.tau))),
            }
            for name, term in [*_name_terms(model), *_merge_lines(model)]
        ],
        "compensated": {name: arrays.log(values) for name, values in view.compensated.items()},
        "datasheet": datasheet_lines(view),
        "spectrum": _pack_spectrum(view, model, rate, arrays),
    }


def _pack_method(
    view: ChannelView, method: str, curve: Mapping[str, Any], arrays: Arrays
) -> dict[str, Any]:
    curves = {
        "tau": arrays.log(curve["tau"]),
        "model": arrays.log(_compute_curve(view.model(method), curve["tau"])),
    }
    if method == view.recommended:
        curves |= {name: arrays.log(curve[name]) for name in ("lower", "upper", "reconstructed")}
    return curves


def _compute_curve(model: NoiseModel, tau: Any) -> Any:
    return np.sqrt(model.allan_variance(tau))


def _name_terms(model: NoiseModel) -> list[tuple[str, Term]]:
    """Return the terms, except spectral lines, with names such as ``white noise N``."""
    return [
        (f"{term.label} {', '.join(term.values)}", term)
        for term in model.terms
        if term not in model.sinusoids
    ]


def _merge_lines(model: NoiseModel) -> list[tuple[str, Any]]:
    """Return the spectral lines of a model as one term."""
    count = len(model.sinusoids)
    if count == 0:
        return []
    return [("line" if count == 1 else f"{count} lines", NoiseModel(sinusoids=model.sinusoids))]


def datasheet_lines(view: ChannelView) -> list[dict[str, Any]]:
    """Return the lines of the datasheet that can be drawn beside the curve of a channel."""
    lines = []
    for row in view.datasheet:
        if row.method != view.recommended or row.comparable is None:
            continue
        if row.statistic not in ("N", "adev_minimum"):
            continue
        name = {"N": "noise density", "adev_minimum": "bias instability"}[row.statistic]
        reading = f"read as {row.sidedness}" if row.sidedness else ""
        about = filter(None, (row.kind, reading))
        lines.append(
            {
                "of": row.statistic,
                "value": row.comparable,
                "label": f"{name} {printed_text(row)} ({', '.join(about)})",
            }
        )
    return lines


def _list_estimates(view: ChannelView, method: str) -> dict[str, Any]:
    """Return value, limits and status of each component of the parameters that are compared."""
    by_symbol: dict[str, list[list[Any]]] = {}
    for symbol in FOREST:
        for row in view.named(method, symbol):
            numbers = (_round_value(number) for number in (row.value, row.lower, row.upper))
            by_symbol.setdefault(symbol, []).append([*numbers, row.status])
    return by_symbol


def _pack_spectrum(
    view: ChannelView, model: NoiseModel, rate: float | None, arrays: Arrays
) -> dict[str, Any] | None:
    if not view.spectrum:
        return None
    spectrum = view.spectrum
    frequency = spectrum["frequency"]
    smooth = np.geomspace(frequency[0], frequency[-1], _SPECTRUM_POINTS)
    # Fewer points than bins suffice for a line.
    some = np.unique(np.linspace(0, len(frequency) - 1, _SPECTRUM_POINTS).round().astype(int))
    fitted, freedom = (np.take(spectrum[name], some) for name in ("fitted", "ordinates"))
    return {
        "frequency": arrays.log(frequency),
        "density": arrays.log(np.sqrt(spectrum["density"])),
        "left": np.flatnonzero(spectrum["used"] == 0).tolist(),
        "fit_frequency": arrays.log(np.take(frequency, some)),
        "fitted": arrays.log(np.sqrt(fitted)),
        # A bin scatters about the fit as chi squared of its degrees of freedom over these.
        **{
            name: arrays.log(np.sqrt(fitted * chdtri(freedom, beyond) / freedom))
            for name, beyond in (("lower", 0.975), ("upper", 0.025))
        },
        "model": next((row.model for row in view.models if row.chosen), ""),
        "smooth": arrays.log(smooth),
        "terms": []
        if not rate
        else [
            {"name": name, "density": arrays.log(np.sqrt(term.psd(smooth, 1.0 / rate)))}
            for name, term in _name_terms(model)
        ],
        "lines": [
            {"frequency": row.frequency, "amplitude": row.amplitude, "kind": row.kind}
            for row in view.lines
        ],
    }


def samples_payload(
    envelope: Sequence[EnvelopeRow], histogram: Sequence[HistogramRow], arrays: Arrays
) -> dict[str, Any]:
    """Return the envelope of the samples of a recording and their histogram, by channel."""
    payload: dict[str, Any] = {"envelope": {}, "histogram": {}}
    for channel, rows in _group_by_channel(envelope).items():
        payload["envelope"][channel] = {
            "start": rows[0].start,
            "end": rows[-1].end,
            "low": arrays.even(numbers(row.low for row in rows)),
            "high": arrays.even(numbers(row.high for row in rows)),
            "mean": arrays.even(numbers(row.mean for row in rows)),
        }
    for channel, bins in _group_by_channel(histogram).items():
        payload["histogram"][channel] = {
            "edges": arrays.exact([bins[0].lower, *(row.upper for row in bins)]),
            "count": arrays.log([row.count for row in bins]),
        }
    return payload


_OfChannel = TypeVar("_OfChannel", bound=ChannelRow)


def _group_by_channel(rows: Sequence[_OfChannel]) -> dict[str, list[_OfChannel]]:
    channels: dict[str, list[_OfChannel]] = {}
    for row in rows:
        channels.setdefault(row.channel, []).append(row)
    return channels


def _round_value(value: float | None) -> float | None:
    # As in `report.html`, so that both print the same digits.
    return None if value is None else float(f"{value:.7g}")


def numbers(values: Iterable[float | None]) -> list[float]:
    """Return the values of a column; NaN where there is none."""
    return [np.nan if value is None else value for value in values]
