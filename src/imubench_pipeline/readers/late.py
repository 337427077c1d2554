"""Sort the records of a log that were written some records too late, as in bags."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import Batch, LogFile
from imubench_pipeline.words.findings.files import LateRecords

MAX_LATE_RECORDS = 1000  # records by which one may be late
_MIN_STEP, _MAX_STEP = 0.5, 3.5  # of sorted stamps around a late one, over the median step
_MAX_LATE_SHARE, _MIN_REGULAR = 0.2, 0.8
"""Largest share of late records, and least share of regular steps of the sorted stamps: other
stamps scatter or run backwards, and do not show the order."""


def sort_late_records(file: LogFile) -> Iterator[Batch]:
    """Yield the batches of a file with its late records in the order of their stamps.

    A record is late if it fills a hole among the at most `MAX_LATE_RECORDS` records before it.
    Anything else keeps the order of the file: stamps that scatter, that are repeated, or that go on
    from an earlier time, as after a restart. Late records are a finding of the file.
    """
    waiting: list[Batch] = []
    records, late, delay = 0, 0, 0.0
    incoming = file.batches()
    while True:
        batch = next(incoming, None)
        if batch is not None and batch.time is None:
            yield batch
            continue
        if batch is not None:
            waiting.append(batch)
            records += len(batch)
            if records <= 2 * MAX_LATE_RECORDS:
                continue
        if not waiting:
            break
        time = np.concatenate([each.time for each in waiting if each.time is not None])
        names = waiting[0].columns
        columns = {name: np.concatenate([b.columns[name] for b in waiting]) for name in names}
        order, end = _find_order(time, 0 if batch is None else MAX_LATE_RECORDS)
        if (order[1:] < order[:-1]).any():
            behind = np.maximum.accumulate(np.where(np.isfinite(time), time, -np.inf)) - time
            moved = order[(order != np.arange(len(order))) & (behind[order] > 0)]
            late, delay = late + len(moved), max(delay, float(behind[moved].max()))
            time, columns = time[order], {name: values[order] for name, values in columns.items()}
        whole = Batch(time, columns)
        if end:
            yield Batch(time[:end], {name: values[:end] for name, values in columns.items()})
        waiting = [whole.after(end)]
        records = len(waiting[0])
        if batch is None:
            break
    if late:
        file.note(LateRecords(file.path.name, late, delay), late, "note")


def _find_order(time: NDArray[np.float64], kept: int) -> tuple[NDArray[np.int64], int]:
    """Return the order of records, and the number of them that need not wait for later ones.

    ``time``: stamps, s, shape (n,). ``kept``: last records before which later ones may belong.
    """
    order = np.arange(len(time))
    if (time[1:] >= time[:-1]).all():  # in order, and no stamp is missing
        return order, max(len(time) - kept, 0)
    present = np.isfinite(time)
    highest = np.maximum.accumulate(np.where(present, time, -np.inf))
    lowest = np.minimum.accumulate(np.where(present, time, np.inf)[::-1])[::-1]
    # Boundaries that no record has to cross: no stamp before is higher than one after.
    free = np.concatenate(([True], highest[:-1] <= lowest[1:], [True]))
    places = np.flatnonzero(free)
    end = int(places[places <= max(len(time) - kept, 0)][-1])
    if len(time) - end > 2 * kept and kept:
        end = len(time) - kept  # too many records would wait
    blocks = np.flatnonzero(np.diff(places) > 1)
    if not len(blocks) or np.mean(time < highest) > _MAX_LATE_SHARE:
        return order, end
    steps = np.diff(np.sort(time[present]))
    typical = float(np.median(steps))
    if np.mean(np.abs(steps - typical) < _MIN_STEP * typical) < _MIN_REGULAR:
        return order, end
    for start, stop in zip(places[blocks].tolist(), places[blocks + 1].tolist(), strict=True):
        if stop - start > MAX_LATE_RECORDS + 1 or stop > end or not present[start:stop].all():
            continue
        within = start + np.argsort(time[start:stop], kind="stable")
        around = np.concatenate(
            (time[max(start - 1, 0) : start], time[within], time[stop : stop + 1])
        )
        gaps = np.diff(around)
        if gaps.min() > _MIN_STEP * typical and gaps.max() < _MAX_STEP * typical:
            order[start:stop] = within
    return order, end
