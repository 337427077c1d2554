"""Change detection over the recordings of one device: expected value and changes.

A noise parameter follows y_k = ln p_k = mu + u_k + e_k, as in `pooled`: u_k has the standard
deviation tau between recordings, and e_k follows from the limits of recording k. A bias is not
transformed: it has no limits, and all its scatter is spread.

mu and tau are estimated from a level, the recordings since the last change, weighted by
1 / (v + tau^2), with tau^2 the excess of the squared residuals over the errors v (method of moments
of DerSimonian and Kacker). From 8 recordings on, residuals are from a straight line: otherwise a
slow drift would increase tau and never be detected. The distance of the next estimate from mu,
divided by sqrt(v + tau^2 + var mu), follows Student's t, with degrees of freedom by Satterthwaite.

A recording is ``changed``, and begins a new level, if p is below `SIGNIFICANCE_LEVEL` / number of
tests (Bonferroni). If the next recording is nearer to the old level, the flagged one was an
outlier. Fewer than three recordings do not determine tau, and nothing is tested. With 42 tests, the
smallest flagged change, in standard deviations, is 75 after 3 recordings; 6.6 after 10; 4 after 50.

References
----------
G. Hahn, J. Am. Stat. Assoc. 64, 1969 (the interval); R. DerSimonian and R. Kacker, Contemp. Clin.
Trials 28, 2007; F. Satterthwaite, Biometrics Bull. 2, 1946; O. Dunn, J. Am. Stat. Assoc. 56, 1961.
"""

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from imubench_pipeline.model.comparisons import DriftRow
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.states import DriftVerdict, Status
from imubench_pipeline.navigation import pooled
from imubench_pipeline.noise import PARAMETERS, TERMS
from imubench_pipeline.words.reasons import pools as texts

Order = Literal["started", "name"]

SIGNIFICANCE_LEVEL = 0.01
"""Maximum probability that any test flags a recording of an unchanged device."""

Estimated = ParameterRow | FixedBiasRow
"""A compared row: a noise parameter, or the mean of a channel."""

_MIN_RECORDINGS = 3  # to estimate the spread between recordings
_MIN_RECORDINGS_FOR_LINE = 8  # a line takes one degree of freedom more
# tau is estimated again with each of 32 recordings, then with each 5 % more
_RECORDINGS_UPDATED_EACH, _UPDATE_GROWTH = 32, 1.05
_COMPARED_NAMES = (*pooled.POOLED_PARAMETERS, "bias")
_BIAS_TERMS = {kind.symbol for kind in TERMS if PARAMETERS["B"] in kind.parameters}
_EMPTY_RESULT = (math.nan, math.nan, math.nan, math.nan, 0.0, -1.0, -1.0)


class Series(NamedTuple):
    """The analysed recordings of one device, in order of time."""

    sensor: str
    device: str
    simulated: bool
    recordings: list[RecordingRow]
    order: Order


def order_of(recordings: Iterable[RecordingRow]) -> tuple[list[RecordingRow], Order]:
    """Return the recordings of one device in order of time, and the key of that order.

    The key is ``started`` if each has an ISO 8601 stamp and not all are the same; a stamp without a
    zone is UTC. Else the key is the name, with numbers in numeric order: run_2 before run_10.
    """

    def split_numbers(row: RecordingRow) -> tuple[list[tuple[str, int]], str]:
        parts = re.findall(r"(\D*)(\d*)", row.recording)
        return [(text.casefold(), int(digits or -1)) for text, digits in parts], row.recording

    by_name = sorted(recordings, key=split_numbers)
    try:
        stamps = [datetime.fromisoformat((row.started or "").strip()) for row in by_name]
    except ValueError:
        return by_name, "name"
    stamps = [stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC) for stamp in stamps]
    if len(set(stamps)) < 2:
        return by_name, "name"
    pairs = sorted(zip(stamps, range(len(stamps)), strict=True))
    return [by_name[index] for _, index in pairs], "started"


def series_of(recordings: Iterable[RecordingRow]) -> Iterator[Series]:
    """Yield a series per device with two ``ok`` recordings or more; simulated ones separately."""
    groups: dict[tuple[str, str, bool], list[RecordingRow]] = {}
    for row in recordings:
        if row.status == "ok":
            groups.setdefault((row.sensor, row.device, row.simulated), []).append(row)
    for key in sorted(groups):
        if len(groups[key]) > 1:
            yield Series(*key, *order_of(groups[key]))


def drift_rows(
    parameters: Iterable[ParameterRow],
    fixed_bias: Iterable[FixedBiasRow],
    recordings: Iterable[RecordingRow],
) -> Iterator[DriftRow]:
    """Yield the rows of the table ``drift``.

    There is one row for each recording of a series and each channel and parameter that any of its
    recordings has, in order of time. The limits of ``expected`` are the 95 % prediction interval
    for this recording. Without a verdict, ``reason`` explains why. ``parameters`` are the rows of
    the recommended method: component 1 of `navigation.pooled.POOLED_PARAMETERS` is used, if ``ok``.
    B and T_B are compared only between models with the same terms.
    """
    cells: dict[tuple[str, str], dict[tuple[str, str], Estimated]] = {}
    for row in parameters:
        if row.parameter in _COMPARED_NAMES and row.component == 1:
            cells.setdefault((row.sensor, row.recording), {})[row.channel, row.parameter] = row
    for bias in fixed_bias:
        cells.setdefault((bias.sensor, bias.recording), {})[bias.channel, "bias"] = bias
    for series in series_of(recordings):
        keys = [(series.sensor, row.recording) for row in series.recordings]
        yield from _make_rows(series, [cells.get(key, {}) for key in keys])


def _make_rows(
    series: Series, cells: Sequence[dict[tuple[str, str], Estimated]]
) -> Iterator[DriftRow]:
    points: dict[tuple[str, str, str], dict[int, tuple[float, ...]]] = {}
    units: dict[tuple[str, str], str] = {}
    for place, cell in enumerate(cells):
        for key, row in cell.items():
            if _get_status(row) != "absent":
                units[key] = row.unit
                points.setdefault((*key, _get_bias_terms(row)), {})[place] = _make_point(row)
    columns = {column: index for index, column in enumerate(sorted(points))}
    data = np.full((3, len(cells), len(columns)), np.nan)
    for column, index in columns.items():
        data[:, list(points[column]), index] = np.transpose(list(points[column].values()))
    # The test of the curve decides for B of one term.
    tested_as = [
        columns.get((channel, "B_curve", ""), index)
        if name == "B" and kind in _BIAS_TERMS
        else index
        for (channel, name, kind), index in columns.items()
    ]
    levels = np.moveaxis(_Levels(data, np.array(tested_as, dtype=int)).results, 0, 2).tolist()
    for key in sorted(
        units, key=lambda key: (key[0][0] != "g", key[0], _COMPARED_NAMES.index(key[1]))
    ):
        noise = key[1] != "bias"
        for place, recording in enumerate(series.recordings):
            own = cells[place].get(key)
            index = columns.get((*key, _get_bias_terms(own)), -1)
            *y, p, changed, count, alone = _EMPTY_RESULT if index < 0 else levels[place][index]
            expected = [
                None if math.isnan(x) else pooled.compute_bounded_exp(x) if noise else x for x in y
            ]
            value = own.value if own is not None and _get_status(own) == "ok" else None
            change = value / expected[0] - 1.0 if noise and value and expected[0] else None
            tested = not math.isnan(p)
            reasons = [] if tested else [_explain_no_verdict(own, count)]
            if alone >= 0.0:
                reasons.append(texts.outlier_before(series.recordings[int(alone)].recording))
            if changed:
                reasons.append(texts.level_changed(round(count), above=changed > 0.0))
                if not noise and key[0].startswith("accel"):
                    reasons.append(texts.TILT_CHANGED)
            verdict: DriftVerdict = "changed" if changed else "as before"
            yield DriftRow(
                sensor=series.sensor,
                device=series.device,
                channel=key[0],
                parameter=key[1],
                recording=recording.recording,
                position=place + 1,
                started=recording.started,
                value=value,
                lower=own.lower if isinstance(own, ParameterRow) else None,
                upper=own.upper if isinstance(own, ParameterRow) else None,
                unit=units[key],
                expected=expected[0],
                expected_lower=expected[1],
                expected_upper=expected[2],
                change=change,
                p_value=p if tested else None,
                verdict=verdict if tested else None,
                reasons=tuple(reasons),
            )


def _get_status(row: Estimated | None) -> Status:
    """Return the status of an estimate; a mean is always ``ok``."""
    if row is None:
        return "absent"
    return row.status if isinstance(row, ParameterRow) else "ok"


def _get_bias_terms(row: Estimated | None) -> str:
    """Return the terms of B and T_B, such as ``F`` or ``GM``; empty for other parameters."""
    if not isinstance(row, ParameterRow) or row.parameter not in ("B", "T_B"):
        return ""
    return "+".join(term for term in row.model.split("+") if term in _BIAS_TERMS)


def _make_point(row: Estimated) -> tuple[float, ...]:
    """Return y and the variances of its error, for a truth below and above; or NaN."""
    if isinstance(row, FixedBiasRow):
        return row.value, 0.0, 0.0
    triple = (row.value if row.status == "ok" else None, row.lower, row.upper)
    if not pooled.is_usable(triple):
        return math.nan, math.nan, math.nan
    y, points = pooled.centre_on_median([triple])
    return y, *points[0][1:]


def _explain_no_verdict(row: Estimated | None, count: float) -> str:
    status = _get_status(row)
    if status != "ok":
        return texts.status_reason(status, row.reason if isinstance(row, ParameterRow) else None)
    if count < 0.0:
        return texts.VALUE_WITHOUT_LIMITS
    if count == 0.0:
        return texts.first_value(_get_bias_terms(row))
    if count < _MIN_RECORDINGS:
        return texts.few_earlier(round(count))
    return texts.NARROW_LIMITS if isinstance(row, ParameterRow) else texts.EQUAL_EARLIER


class _Levels:
    """The levels of c columns through n recordings.

    ``points`` (3, n, c): y, and the variances of its error for a truth below and above, or NaN.
    ``results`` (7, n, c): expected y and its two limits; p-value or NaN; 1 or -1 for a change, else
    0; number of earlier recordings in the level, or -1; index of the flagged recording that this
    one shows to be an outlier, or -1. ``tested_as`` (c,): column that gives a column its p-value
    and verdict.
    """

    def __init__(self, points: NDArray[np.float64], tested_as: NDArray[np.int64]) -> None:
        _, recordings, columns = points.shape
        self._points = points
        self._tested_as = tested_as
        self.results = np.tile(np.reshape(_EMPTY_RESULT, (-1, 1, 1)), (recordings, columns))
        self._member = np.zeros((recordings, columns), dtype=bool)
        self._state = np.zeros((7, columns))
        self._replaced: dict[int, tuple[int, NDArray[np.bool_], NDArray[np.float64]]] = {}
        with np.errstate(all="ignore"):
            for place in range(recordings):
                self._add_recording(place)

    def _add_recording(self, place: int) -> None:
        y, below, above = self._points[:, place]
        present = np.isfinite(y)
        for column in [column for column in self._replaced if present[column]]:
            self._restore_level(place, column)
        self._update_levels()
        # Number of recordings; how many of them gave tau; mu; 1 / var mu; tau^2; its degrees of
        # freedom times the mean of 1 / (v + tau^2); the degrees of freedom.
        count, _, mean, weight, spread, information, freedom = self._state
        own = spread + np.stack([np.where(y < mean, above, below), above, below])
        error = np.sqrt(own + 1.0 / weight)
        degrees = np.minimum((own * information) ** 2 / freedom, freedom)
        judged = present & (count >= _MIN_RECORDINGS) & (own[0] > 0.0) & (degrees[0] >= 1.0)
        p_value = 2.0 * stdtr(degrees[0], -np.abs(y - mean) / error[0])
        half = stdtrit(np.maximum(degrees[1:], 1.0), 0.975) * error[1:]
        here = np.arange(len(y))
        test = np.where(judged[self._tested_as], self._tested_as, here)
        p_value = p_value[test]
        changed = judged & (p_value < SIGNIFICANCE_LEVEL / max((judged & (test == here)).sum(), 1))
        of_judged = np.stack([mean - half[0], mean + half[1], p_value, changed * np.sign(y - mean)])
        self.results[1:5, place, judged] = of_judged[:, judged]
        self.results[5, place, present] = count[present]
        self.results[0, place, present & (count > 0.0)] = mean[present & (count > 0.0)]
        for column in np.flatnonzero(changed).tolist():
            member, state = self._member[:, column], self._state[:, column]
            self._replaced[column] = place, member.copy(), state.copy()
            member[:], state[:] = False, 0.0
        self._member[place] = present
        added = np.where(present, 1.0 / np.where(own[0] > 0.0, own[0], 1.0), 0.0)
        count += present
        weight += added
        mean += np.where(present, added / weight * (y - mean), 0.0)

    def _restore_level(self, place: int, column: int) -> None:
        """Restore the previous level if a value is nearer to it than to the flagged one."""
        flagged, member, state = self._replaced.pop(column)
        y, below, above = self._points[:, place, column]
        new, new_below, new_above = self._points[:, flagged, column]
        old, weight, spread = state[2:5]
        own = (above if y < old else below) + spread + 1.0 / weight
        both = (above + new_below if y < new else below + new_above) + 2.0 * spread
        if (y - old) ** 2 * both < (y - new) ** 2 * own:
            self._member[:, column], self._state[:, column] = member, state
            self.results[6, place, column] = flagged

    def _update_levels(self) -> None:
        """Update mu and tau of the levels that have grown (Satterthwaite; DerSimonian-Kacker)."""
        count, settled = self._state[:2]
        due = np.flatnonzero(
            (count > settled)
            & ((count <= _RECORDINGS_UPDATED_EACH) | (count >= _UPDATE_GROWTH * settled))
        )
        if not due.size:
            return
        rows = np.flatnonzero(self._member[:, due].any(axis=1))[:, np.newaxis]
        member = self._member[rows, due]
        y, below, above = np.where(member, self._points[:, rows, due], 0.0)
        y = np.where(member, y - self._state[2, due], 0.0)  # keeps the digits of narrow limits
        line = count[due] >= _MIN_RECORDINGS_FOR_LINE
        weight = member.astype(np.float64)
        for _ in range(3):
            total = weight.sum(axis=0)
            mean = (weight * y).sum(axis=0) / total
            variance = np.where(y < mean, above, below)
            along = rows - (weight * rows).sum(axis=0) / total
            squares = np.where(line, (weight * along**2).sum(axis=0), np.inf)
            left = y - mean - (weight * along * y).sum(axis=0) / squares * along
            free = weight * (1.0 - weight / total - weight * along**2 / squares)
            information = free.sum(axis=0)
            spread = np.fmax((weight * left**2 - free * variance).sum(axis=0) / information, 0.0)
            weight = member / np.where(variance + spread > 0.0, variance + spread, 1.0)
        self._state[1, due] = count[due]
        self._state[2, due] += mean
        self._state[3:, due] = total, spread, information, count[due] - 1.0 - line
