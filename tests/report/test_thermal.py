from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.report.recording import describe_thermal, list_thermal_figures
from imubench_pipeline.report.view import ChannelView, gather_recordings
from tests.report.tables import DEGREE, HOUR, MODEL, Rows, joined, recording_rows

CONFUSED = "the temperature is too close to a ramp"
NAMES = {"sensor": "imu", "recording": "day1", "channel": "gyro_x"}


def channel(rows: Rows) -> ChannelView:
    (view,) = gather_recordings(joined(rows))
    (found,) = view.channels()
    return found


def warm(
    temperature: str | None = "followed",
    changes: Mapping[tuple[str, str], Mapping[str, Any]] | None = None,
    **given: Any,
) -> ChannelView:
    """A channel, with changes of its rows by table and parameter."""
    rows = recording_rows(temperature=temperature, **given)
    for (table, parameter), change in (changes or {}).items():
        for row in rows[table]:
            if row["parameter"] == parameter:
                row.update(change)
    return channel(rows)


def lines(view: ChannelView) -> dict[str, dict[str, Any]]:
    found = list(list_thermal_figures(view))
    named = {line["term"]: line for line in found}
    assert len(named) == len(found)
    return named


# In sentences.


def test_thermal_text_has_sensitivity_and_compensated_deviation() -> None:
    said = describe_thermal(warm(), "practical")
    assert said == [
        "The bias changes with temperature by 90 °/h/K. Compensated, the Allan deviation is lower "
        "by a factor of 2 at τ = 100 s, 2 at τ = 300 s, 2 at τ = 1000 s.",
        "Ranking, datasheet comparison and budgets use the log with its temperature effect. The "
        "method “temperature compensated” gives the noise at constant temperature.",
        "The mean temperature T₀ is 22.5 °C.",
        "The sensor's own low-pass has its cut-off at 64 Hz (first order).",
    ]
    assert describe_thermal(warm(), "si")[0].startswith(
        "The bias changes with temperature by 0.000436 rad/s/K."
    )
    accel = warm(channels=("accel_x",))
    # The same number in m/s^2/K.
    assert describe_thermal(accel, "practical")[0].startswith(
        "The bias changes with temperature by 44.5 µg/K."
    )


def test_only_where_the_curve_is_lower_it_is_said_so() -> None:
    rows = recording_rows(temperature="followed")
    for row, measured in zip(rows["allan_compensated"], rows["allan"], strict=True):
        row["adev"] = measured["adev"] / (3.0 if row["tau"] > 500 else 1.001)
    said = describe_thermal(channel(rows), "practical")[0]
    assert said.endswith("the Allan deviation is lower by a factor of 3 at τ = 1000 s.")
    for row, measured in zip(rows["allan_compensated"], rows["allan"], strict=True):
        row["adev"] = 1.02 * measured["adev"]
    said = describe_thermal(channel(rows), "practical")[0]
    assert said == "The bias changes with temperature by 90 °/h/K."


def test_the_times_that_are_told_are_those_of_the_curve() -> None:
    rows = recording_rows(temperature="followed")
    rows["allan_compensated"] = [row for row in rows["allan_compensated"] if row["tau"] < 400]
    longest = max(row["tau"] for row in rows["allan_compensated"])
    said = describe_thermal(channel(rows), "practical")[0]
    assert ("300 s" in said) == (longest >= 300)
    assert "100 s" in said and "1000 s" not in said


def test_a_fall_is_read_at_equal_times() -> None:
    # The curve of what is left has fewer points: between them it is as the measured one is.
    rows = recording_rows(temperature="followed")
    tau = np.array([50.0, 200.0, 900.0])
    adev = np.interp(np.log(tau), np.log([row["tau"] for row in rows["allan"]]),
                     [row["adev"] for row in rows["allan"]])  # fmt: skip
    rows["allan_compensated"] = [
        NAMES
        | {
            "tau": t,
            "adev": a / 4,
            "lower": a / 5,
            "upper": a / 3,
            "temperature": a,
            "edf_source": "fitted spectrum",
        }
        for t, a in zip(tau, adev, strict=True)
    ]
    said = describe_thermal(channel(rows), "practical")[0]
    assert said.endswith("lower by a factor of 4 at τ = 100 s, 4 at τ = 300 s.")


def test_a_temperature_that_is_not_taken_out_says_why() -> None:
    said = describe_thermal(warm(CONFUSED), "practical")
    assert said[:2] == [
        f"The temperature effect is not removed: {CONFUSED}.",
        "The mean temperature T₀ is 22.5 °C.",
    ]


def test_a_log_without_temperature_says_nothing_of_it() -> None:
    assert describe_thermal(warm(None), "practical") == []
    assert list(list_thermal_figures(warm(None))) == []
    rows = recording_rows(temperature="followed")
    rows["temperature"] = rows["allan_compensated"] = []
    assert describe_thermal(channel(rows), "practical") == [
        "The sensor's own low-pass has its cut-off at 64 Hz (first order)."
    ]
    assert set(lines(channel(rows))) == {"cutoff", "N_sensor"}


def low_pass(**changes: Any) -> dict[tuple[str, str], dict[str, Any]]:
    return {("low_pass", "cutoff"): changes}


def test_the_order_of_a_butterworth_filter_is_said() -> None:
    said = describe_thermal(warm(changes=low_pass(order=3)), "practical")
    assert said[-1].endswith("has its cut-off at 64 Hz (Butterworth, order 3).")


def test_no_low_pass_is_said_and_has_no_line() -> None:
    none = {("low_pass", "cutoff"): {"value": None, "lower": None, "upper": None, "order": None,
                                     "status": "absent", "reason": "it shows none"}}  # fmt: skip
    view = warm(changes=none)
    assert (
        describe_thermal(view, "practical")[-1] == "The spectrum shows no low-pass of the sensor."
    )
    assert "cutoff" not in lines(view)


def test_a_cutoff_that_is_not_known_has_its_limits_and_why() -> None:
    reason = "the log allows cut-offs from 50 to 90 Hz"
    unknown = {("low_pass", "cutoff"): {"value": None, "lower": 50.0, "upper": 90.0,
                                        "status": "not_identified", "reason": reason}}  # fmt: skip
    view = warm(changes=unknown)
    assert "low-pass" not in " ".join(describe_thermal(view, "practical"))
    line = lines(view)["cutoff"]
    assert (line["value"], line["lower"], line["upper"]) == (None, 50.0, 90.0)
    assert (line["status"], line["why"]) == ("not_identified", reason[0].upper() + reason[1:] + ".")


# In a table.


def test_figures_have_units_and_limits() -> None:
    found = lines(warm())
    assert list(found) == [
        "temperature_sensitivity", "thermal_lag", "bias_at_reference", "cutoff",
        "N_sensor",
    ]  # fmt: skip
    assert {term: line["unit"] or line["sign"] for term, line in found.items()} == {
        "temperature_sensitivity": "gyro.sensitivity",
        "thermal_lag": "s",
        "bias_at_reference": "gyro.signal",
        "cutoff": "Hz",
        "N_sensor": "gyro.N",
    }
    s = found["temperature_sensitivity"]
    assert (s["value"], s["lower"], s["upper"]) == pytest.approx((90 * HOUR, 81 * HOUR, 99 * HOUR))
    assert s["status"] == "" and s["words"] == "sensitivity"
    assert found["cutoff"]["value"] == 64.0 and found["N_sensor"]["value"] == 14 * HOUR


def test_a_figure_that_is_not_identified_has_limits_and_reason() -> None:
    lag = lines(warm())["thermal_lag"]
    assert (lag["value"], lag["lower"], lag["upper"]) == (None, 0.0, 60.0)
    assert (lag["status"], lag["why"]) == ("not_identified", "It may be 0.")


def test_what_the_data_do_not_ask_for_has_no_line() -> None:
    assert "temperature_quadratic" not in lines(warm())
    curved = {"value": 2 * HOUR, "lower": HOUR, "upper": 3 * HOUR, "status": "ok", "reason": None}
    view = warm(changes={("temperature", "quadratic"): curved})
    line = lines(view)["temperature_quadratic"]
    assert (line["value"], line["unit"], line["why"]) == (2 * HOUR, "gyro.quadratic", "")


def test_a_sensitivity_that_is_not_taken_out_has_its_line_and_why() -> None:
    line = lines(warm(CONFUSED))["temperature_sensitivity"]
    assert line["value"] == 90 * HOUR
    assert line["why"] == "The temperature is too close to a ramp."


def test_the_truth_of_a_simulation_stands_beside_it() -> None:
    rows = recording_rows(temperature="followed", simulated=True)
    true = {
        "sensitivity": 91 * HOUR,
        "lag": 30.0,
        "cutoff": 60.0,
        "bias": 2 * DEGREE,
        "N_sensor": 0.8 * MODEL.N,
    }
    rows["simulated_truth"] += [
        NAMES | {"parameter": name, "component": 1, "value": value, "unit": "x", "assumed": False,
                 "source": "here"}
        for name, value in true.items()
    ]  # fmt: skip
    found = lines(channel(rows))
    assert found["temperature_sensitivity"]["truth"] == 91 * HOUR
    assert found["thermal_lag"]["truth"] == 30.0 and found["cutoff"]["truth"] == 60.0
    assert found["N_sensor"]["truth"] == 0.8 * MODEL.N
    # The true bias is that at the reference of the simulation, not at the mean of the log.
    assert found["bias_at_reference"]["truth"] is None
    assert all(line["truth"] is None for line in lines(warm()).values())
