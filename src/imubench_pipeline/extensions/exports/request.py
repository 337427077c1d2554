"""Make the file of a program from the tables of a run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.estimators.rows import read_draws
from imubench_pipeline.extensions.exports import imu
from imubench_pipeline.extensions.exports import reasons as texts
from imubench_pipeline.extensions.exports.choice import WORST, Choice, choose, pool_recordings
from imubench_pipeline.extensions.exports.in_use import InUseNoise
from imubench_pipeline.extensions.exports.mapping import bound_walk, describe_terms
from imubench_pipeline.extensions.exports.modes import Mode, apply_mode, choose_mode
from imubench_pipeline.extensions.exports.of_models import find_target
from imubench_pipeline.extensions.exports.overbound import FAMILIES, MAX_EXCESS, Family, overbound
from imubench_pipeline.extensions.exports.targets import TARGETS
from imubench_pipeline.model.estimates import AllanRow, ParameterRow, TemperatureRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.table import R
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.tables.files import find_tables, find_tables_folder, read
from imubench_pipeline.words.reasons.pools import recordings_not_used
from imubench_pipeline.words.verdicts import doubts_text

Tables = Mapping[str, pa.Table]

NEEDED = ("recordings", "parameters", "allan", "temperature")
"""The tables that a request reads."""

_SHORTEST_BOUNDED = 1.0
"""Shortest tau of an upper bound, s: below it vibration and resolution enter, which do not grow."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """Options of an exported file."""

    sensor: str
    target: str
    axis: str = WORST  # ``worst``, ``median``, a device or a recording (`choice.choose`)
    horizon: float = 60.0  # s
    inflation: float = 1.0
    because: str | None = None
    """Reason of the inflation, or of the use of recordings that are excluded from decisions."""
    mode: Mode | None = None  # None: of the target (`modes.choose_mode`)
    most_excess: float = MAX_EXCESS
    """Max. ratio of the Allan deviation of an overbound to its limit; a larger one is refused."""
    method: str | None = None  # of estimation; None: the recommended one
    rate: float | None = None  # of the program's samples, Hz; None: the rate of the recording
    ros_topic: str | None = None  # of the samples
    one_device: bool = False  # all recordings are of one device, and are pooled
    in_use: Mapping[str, InUseNoise] | None = None  # noise of a log in use, by channel


def load(path: Path) -> dict[str, pa.Table]:
    """Read the tables of a run from the folder of its results, or from ``tables`` in it.

    Raises ExportError if a table is missing, or has other columns.
    """
    try:
        return {name: read(name, [table]) for name, table in find_tables(path, NEEDED).items()}
    except (OSError, ValueError) as error:
        raise imu.ExportError(str(error)) from error


def recordings_of(path: Path) -> Path:
    """Return the folder of the recordings of a run, for a path as in `load`."""
    return find_tables_folder(path).parent / "recordings"


def make_content(tables: Tables, request: Request, recordings: Path | None = None) -> str | bytes:
    """Return the content of the file, from the tables `NEEDED` of a run.

    ``recordings`` is the folder of the recordings of the run. Their tables ``draws`` contain the
    posterior of the fits, for an overbound. Raises ExportError if the sensor or target is not
    known, or the target does not support the estimates.
    """
    return find_target(request.target).write(build_imu(tables, request, recordings))


def build_imu(tables: Tables, request: Request, folder: Path | None = None) -> imu.Imu:
    """Return the noise of the sensor that a request names; arguments as in `make_content`."""
    recordings = _select_rows(RecordingRow, tables, sensor=request.sensor)
    if not recordings:
        sensors = sorted(set(tables["recordings"]["sensor"].to_pylist()))
        raise imu.ExportError(f"no sensor {request.sensor!r}; there are: {', '.join(sensors)}")
    by_name = {row.recording: row for row in recordings}
    rows, cautions = _select_deciding(tables, request, recordings)
    mode = choose_mode(request.mode, request.target)
    axes: dict[str, imu.AxisNoise] = {}
    rates: list[float] = []
    effects: dict[str, imu.TemperatureEffect] = {}
    simulated = False
    for quantity in ("gyro", "accel"):
        if not any(row.channel.startswith(f"{quantity}_") for row in rows):
            continue
        choice = choose(
            rows,
            quantity,
            axis=request.axis,
            horizon=request.horizon,
            devices={row.recording: row.device for row in recordings},
            method=request.method,
        )
        place = {"sensor": request.sensor, "recording": choice.recording}
        about = by_name[choice.recording]
        if about.doubts:
            cautions.append(f"{choice.recording} is in doubt: {doubts_text(about.doubts)}")
        simulated = simulated or about.simulated
        if about.rate is None:
            raise imu.ExportError(f"{choice.recording}: its rate is not known; state it (--rate)")
        rates.append(float(f"{about.rate:.9g}"))  # time stamps are not more accurate
        warmed = _select_rows(TemperatureRow, tables, **place)
        effects[quantity] = imu.find_temperature_effect(warmed, about, quantity, request.horizon)
        every = (choice, *choice.each.values())
        if mode == "bounded":
            chosen, *own = (_bound_axis(tables, request, one, about.rate, folder) for one in every)
            largest = {
                name: max(getattr(one.model, name) for one in (chosen, *own)) for name in "NK"
            }  # one number for all axes is above each of them
            chosen = replace(chosen, model=replace(chosen.model, **largest))
        else:
            chosen, *own = (_make_axis(tables, request, rows, one) for one in every)
        axes[quantity] = replace(chosen, each=dict(zip(choice.each, own, strict=True)))
    if not axes:
        reasons = "; ".join(row.reason for row in recordings if row.reason)
        raise imu.ExportError(
            f"{request.sensor}: no estimate; its recordings are left out: {reasons}"
        )
    built = imu.Imu(
        sensor=request.sensor,
        rate=request.rate or max(rates),
        estimated=axes,
        horizon=request.horizon,
        inflation=request.inflation,
        because=request.because,
        simulated=simulated,
        cautions=tuple(dict.fromkeys(cautions)),
        temperature=effects,
        ros_topic=request.ros_topic or imu.Imu.ros_topic,
    )
    return apply_mode(built, TARGETS[request.target], mode, request.in_use)


def _select_deciding(
    tables: Tables, request: Request, recordings: Sequence[RecordingRow]
) -> tuple[list[ParameterRow], list[str]]:
    """Return the estimates that an export may use, and cautions about the others."""
    rows = _select_rows(ParameterRow, tables, sensor=request.sensor)
    apart = list_excluded(recordings)
    without = [
        f"{row.recording} is not used, as it was {row.status}: {row.reason or 'no reason is known'}"
        for row in recordings
        if row.status != "ok"
    ]
    if not apart:
        return rows, without
    doubted = [(recording, doubts_text(doubts)) for (_, recording), doubts in apart.items()]
    reasons = recordings_not_used(doubted)
    if (request.because or "").strip():
        return rows, [f"{reasons}; used all the same, because: {request.because or ''}", *without]
    deciding = [row for row in rows if (row.sensor, row.recording) not in apart]
    if rows and not deciding:
        raise imu.ExportError(
            f"{reasons}; see the findings. To use it anyway, state the reason: --because, or "
            "'exports: because' or 'decide: include' in a project"
        )
    return deciding, [reasons, *without]


def _make_axis(
    tables: Tables, request: Request, rows: Sequence[ParameterRow], choice: Choice
) -> imu.AxisNoise:
    """Return the noise of a choice at rest: pooled, or with a limit of what no log determines."""
    if request.one_device:
        choice = pool_recordings(rows, choice, request.method)
    if choice.determined:
        return choice.axis
    return _limit_walk(choice.axis, _find_curve(tables, request.sensor, choice), request.horizon)


def _find_curve(tables: Tables, sensor: str, choice: Choice) -> AllanCurve:
    place = {"sensor": sensor, "recording": choice.recording, "channel": choice.channel}
    return curve_of(_select_rows(AllanRow, tables, **place))


def _limit_walk(axis: imu.AxisNoise, curve: AllanCurve, horizon: float) -> imu.AxisNoise:
    """Return an axis with an upper limit of K in place of slow terms that no log determines."""
    K = bound_walk(curve, axis.model.N, horizon)
    model = NoiseModel(Q=axis.model.Q, N=axis.model.N, K=K, sinusoids=axis.model.sinusoids)
    notes = [texts.limit_of_walk(K, horizon), *axis.notes]
    return replace(axis, model=model, notes=notes, slow_limited=True)


def _bound_axis(
    tables: Tables, request: Request, choice: Choice, rate: float, folder: Path | None
) -> imu.AxisNoise:
    """Return the smallest model above the measured curve of the chosen axis."""
    family = TARGETS[request.target].family
    drawn = None
    if folder is not None:
        path = folder / request.sensor / choice.recording / "draws.parquet"
        if path.is_file():
            drawn = read_draws(path).get((choice.channel, choice.method))
    try:
        bound = overbound(
            _find_curve(tables, request.sensor, choice),
            choice.axis.model,
            rate,
            family=family,
            horizon=request.horizon,
            shortest=_SHORTEST_BOUNDED if request.horizon > 2.0 * _SHORTEST_BOUNDED else 0.0,
            most_excess=request.most_excess,
            drawn=[drawn.model(number) for number in range(len(drawn))] if drawn else [],
        )
    except ValueError as error:
        larger = _list_larger_programs(family)
        raise imu.ExportError(
            f"{choice.channel} of {choice.recording}: {'; '.join([str(error), *larger])}; or "
            f"take a horizon shorter than {request.horizon:g} s, or the mode bench, or allow a "
            "larger excess"
        ) from error
    fitted = f"the fitted model was: {describe_terms(choice.axis.model.terms)}"
    notes = [*bound.words, fitted, *choice.axis.notes]
    if bound.warning:
        notes.insert(0, f"WARNING: {'; '.join([bound.warning, *_list_larger_programs(family)])}")
    return replace(choice.axis, model=bound.model, notes=notes, bounded=bound.band)


def _list_larger_programs(family: Family) -> list[str]:
    kinds = {
        other: [name for name, target in TARGETS.items() if target.family == other]
        for other in FAMILIES
        if set(other.split("+")) - set(family.split("+"))
    }
    return [
        f"{other} is supported by {', '.join(names)}" for other, names in kinds.items() if names
    ]


def curve_of(rows: Sequence[AllanRow]) -> AllanCurve:
    """Return the curve of one channel from rows of ``allan``; ExportError without any."""
    if not rows:
        raise imu.ExportError("the channel has no Allan variance; analyse a longer log of it")
    return AllanCurve(
        tau=np.array([row.tau for row in rows]),
        cluster_size=np.array([row.cluster_size for row in rows], dtype=np.int64),
        variance=np.array([row.adev for row in rows]) ** 2,
        edf=np.array([row.edf for row in rows]),
        edf_upper=np.array([row.edf_upper for row in rows]),
    )


def _select_rows(of: type[R], tables: Tables, **wanted: str) -> list[R]:
    table = tables[of.table]
    for name, value in wanted.items():
        table = table.filter(pc.equal(table[name], value))
    return of.rows_of(table)
