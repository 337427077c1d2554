"""`imubench check`: check new logs; no estimation, no stored results."""

import tempfile
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.datasheets.plausibility import implausible_of
from imubench_pipeline.estimators.deterministic.courses import find_deterministic_signals
from imubench_pipeline.estimators.deterministic.verdict import assess_signals
from imubench_pipeline.estimators.frame import select_for_fit
from imubench_pipeline.estimators.spectral_findings import spectral_findings
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.recordings.drop_zone import Recording
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.recordings.recording import ChannelLog, LogNames, open_static_logs
from imubench_pipeline.report.run_summary import fold_text
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.config import AllanSettings
from imubench_pipeline.steps.allan import compute_channel_curve, report_too_sparse
from imubench_pipeline.tables.failures import Failure, describe_error
from imubench_pipeline.tables.findings import Finding


def check(plan: Plan) -> Iterator[tuple[str, str, Quality]]:
    """Yield sensor, recording and quality of each recording of a plan, except simulated ones."""
    for (sensor, name), recording in plan.recordings.items():
        if recording.simulated:
            continue
        try:
            with tempfile.TemporaryDirectory(prefix="imubench.") as folder:
                quality = _check_recording(plan, recording, Path(folder))
        except Exception as error:  # the others are checked all the same
            reason = fold_text(f"{recording.path.name}: {describe_error(error)}")
            failure = Failure(sensor, name, "check", "error", reason)
            names = LogNames(sensor=sensor, device=name, recording=name)
            row = RecordingRow(**vars(names), status="failed")
            quality = Quality(row, [failure.finding().row(sensor, name)], {})
        yield sensor, name, quality


def _check_recording(plan: Plan, recording: Recording, folder: Path) -> Quality:
    key = recording.sensor, recording.name
    settings = plan.ingest_settings(*key)
    quality = ingest_as_planned(recording.path, settings, *key, folder, guarded=True)
    quality.findings.extend(implausible_of(quality, plan.sensors.get(recording.sensor)))
    how = AllanSettings.model_validate_json(plan.settings("allan"))
    for channel, log in open_static_logs(folder).items():
        for finding in findings_of_channel(channel, log, plan.bandwidth(*key), how):
            quality.findings.append(finding.row(*key))
    return quality


def findings_of_channel(
    channel: str, log: ChannelLog, bandwidth: float | None, settings: AllanSettings
) -> list[Finding]:
    """Return findings on drift, steps, spectral lines and the band limit; `bandwidth` in Hz."""
    if log.holes and not len(compute_channel_curve(log, settings).tau):
        return [report_too_sparse(channel, log)]
    highest = 0.5 * bandwidth if bandwidth else None
    signals = find_deterministic_signals(
        log.blocks, log.grid, log.rate, segments=log.segments, highest=highest
    )
    about = assess_signals(channel, signals, has_temperature=bool(log.temperature))
    findings = list(about.findings)
    if not log.holes:  # filling gaps needs a model, which only the estimation has
        spectrum, line_spectra = compute_spectra(log.blocks(), log.grid, log.rate, log.segments)
        frame = select_for_fit(spectrum, line_spectra, bandwidth=bandwidth)
        findings += spectral_findings(channel, frame, None)
    return findings
