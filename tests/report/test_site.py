from dataclasses import replace
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.model.comparisons import DriftRow
from imubench_pipeline.report.sensor import describe_change
from imubench_pipeline.report.site import Page, Site, name_sensors
from imubench_pipeline.report.start import START, summarise_recordings
from tests.report.tables import (
    KNOWN,
    MODEL,
    Rows,
    joined,
    recording_rows,
    rejected_rows,
    site,
)


def of(*several: Rows, **given: Any) -> Site:
    return site(joined(*several), **given)


def device_pages(*several: Rows) -> list[str | None]:
    return [view.device_page for view in of(*several).views]


def series(*factors: float, sensor: str = "imu", **about: Any) -> list[Rows]:
    """Recordings of one device with so many times the white noise, known to 1 %."""
    return [
        recording_rows(
            sensor,
            f"run{number}",
            device="unit 7",
            started=f"2024-01-{number:02}T00:00:00Z",
            parameters=KNOWN
            | {"N": Parameter(f * MODEL.N, lower=0.99 * f * MODEL.N, upper=1.01 * f * MODEL.N)},
            **about,
        )
        for number, f in enumerate(factors, start=1)
    ]


def test_a_recording_has_the_page_of_its_name_below_that_of_its_sensor() -> None:
    pages = [view.page for view in of(recording_rows("a", "r"), rejected_rows("b", "r")).views]
    assert pages == ["recordings/a/r.html", "recordings/b/r.html"]


def test_a_device_has_a_page_where_it_has_a_name_or_several_recordings() -> None:
    assert device_pages(recording_rows(recording="r")) == [None]
    assert device_pages(recording_rows(recording="r", device="sn 12")) == ["devices/imu/sn 12.html"]
    shared = recording_rows(recording="r"), recording_rows(recording="q", device="r")
    assert device_pages(*shared) == ["devices/imu/r.html"] * 2
    other = recording_rows("a", "r"), recording_rows("b", "q", device="r")
    assert device_pages(*other) == [None, "devices/b/r.html"]


@settings(max_examples=20)
@given(st.lists(st.tuples(st.sampled_from(["r", "q", "x"]), st.booleans()), max_size=6))
def test_measured_and_simulated_recordings_never_share_a_device_page(
    devices: list[tuple[str, bool]],
) -> None:
    views = of(
        *(
            rejected_rows(recording=f"n{i}", device=device, simulated=simulated)
            for i, (device, simulated) in enumerate(devices)
        )
    ).views
    pages: dict[str, set[tuple[str, bool]]] = {}
    for view in views:
        assert view.device_page is not None
        pages.setdefault(view.device_page, set()).add((view.row["device"], view.simulated))
    assert all(len(found) == 1 for found in pages.values())
    assert len(pages) == len(set(devices))


hostile = st.text(st.characters(exclude_categories=["Cs", "Cc"]), min_size=1, max_size=100)


@settings(max_examples=20)
@given(st.lists(hostile, min_size=1, max_size=4, unique=True))
@example(["a/b", "a\\b", "a_b", "../x", "..", "#1?", "100%", "<script>"])
@example(["漢" * 80, "漢" * 81, "漢" * 82])
def test_a_device_of_any_name_has_a_page_of_its_own_that_a_folder_can_hold(
    names: list[str],
) -> None:
    pages = device_pages(
        *(rejected_rows(recording=f"n{i}", device=name) for i, name in enumerate(names))
    )
    assert len(set(pages)) == len(names)
    for page in pages:
        assert page is not None
        folder, _, file = page.rpartition("/")
        assert folder == "devices/imu"
        # A write puts a temporary name beside it.
        assert len(f".{file}.12345678.part".encode()) <= 255
        assert not set(file) & set('<>:"|?*\\#%&')


def test_a_simulated_device_is_not_taken_for_one_whose_name_says_so() -> None:
    views = of(
        rejected_rows(recording="p", device="x", simulated=True),
        rejected_rows(recording="q", device="x-simulated"),
    ).views
    assert views[0].device_page != views[1].device_page


def test_sensors_are_named_by_vendor_and_model_or_by_their_folder() -> None:
    made = of(recording_rows("b", "r"), rejected_rows("a", "r"))
    del made.settings["sensors"]["a"]  # type: ignore[attr-defined]  # settings are nested mappings
    assert made.sensors == ["a", "b"]
    assert made.names == {"a": "a", "b": "V & Co b"}
    assert list(made.looks) == ["a", "b"]


def test_channels_stand_in_their_order_and_only_where_there_are_any() -> None:
    made = of(recording_rows("a", "r", ("accel_x", "gyro_z")), recording_rows("b", "r"))
    assert made.channel_names == ["gyro_x", "gyro_z", "accel_x"]
    assert of(rejected_rows()).channel_names == []


@pytest.mark.parametrize(
    ("path", "root"),
    [("index.html", ""), ("sensors/a.html", "../"), ("recordings/a/r.html", "../../")],
)
def test_a_page_knows_the_way_to_the_folder_of_the_report(path: str, root: str) -> None:
    assert Page(path, "", "", dict).root == root


def test_tables_of_one_recording_are_not_offered_and_none_in_one_file() -> None:
    shown = of().shown()["tables"]
    assert "parameters" in shown and "drift" in shown
    assert not {"envelope", "histogram"} & set(shown)
    assert of().shown(alone=True)["tables"] == []


def test_changed_devices_lists_changed_parameters() -> None:
    (changed,) = of(*series(1.0, 1.001, 0.999, 1.0, 1.001, 3.0)).changed_devices()
    assert (changed["sensor"], changed["device"], changed["recording"]) == ("imu", "unit 7", "run6")
    assert changed["page"] == "devices/imu/unit 7.html"
    assert changed["channels"] == "N of gyro x"
    assert of(*series(1.0, 1.001, 0.999, 1.0, 1.001)).changed_devices() == []


def test_a_change_is_told_in_words() -> None:
    row = DriftRow(
        sensor="imu",
        device="unit 7",
        channel="gyro_x",
        parameter="N",
        recording="r",
        position=2,
        unit="SI",
        change=-0.256,
        p_value=0.00012,
    )
    assert describe_change(row, simulated=False) == ("r, gyro x: N changed by −26 % (p = 0.0001).")
    bias = replace(row, parameter="bias", change=None, p_value=0.002)
    assert describe_change(bias, simulated=True) == (
        "r (simulated), gyro x: fixed bias changed (p = 0.002)."
    )


@pytest.mark.parametrize(
    "changed",
    [
        {"title": "another"},
        {"units": "si"},
        {"requirements": {"x": {"title": "x", "static_window": "10 s", "limits": [
            {"error": "heading", "after": "1 s", "at_most": "1 deg"}]}}},
    ],
)  # fmt: skip
def test_settings_are_part_of_the_key_of_every_page(changed: dict[str, Any]) -> None:
    assert of(recording_rows(), **changed).common != of(recording_rows()).common


def test_code_is_part_of_the_key_of_every_page() -> None:
    one, other = of(recording_rows()), of(recording_rows())
    other.code = "0123"
    assert one.common != other.common
    assert one.key_of("x") != other.key_of("x")
    assert START.page(one).key != START.page(other).key


def test_parts_of_a_key_do_not_run_together() -> None:
    made = of()
    assert made.key_of("ab", "c") != made.key_of("a", "bc")
    assert made.key_of("a", None) != made.key_of("a")
    assert made.key_of(b"ab", b"c") != made.key_of(b"a", b"bc")


def test_a_summary_says_how_many_recordings_how_long_and_of_when() -> None:
    views = of(
        recording_rows("a", "p", started="2024-02-03T10:00:00Z"),
        recording_rows("a", "q", started="2023-12-31T10:00:00Z", simulated=True),
        rejected_rows("b", "r"),
    ).views
    assert summarise_recordings(views) == (
        "3 recordings of 2 sensors, 4 h of data, recorded from 2023-12-31 to 2024-02-03, "
        "1 rejected. 1 of them is simulated, not measured."
    )
    assert summarise_recordings(views[1:2], several=False) == (
        "1 recording, 2 h of data, recorded on 2023-12-31. It is simulated, not measured."
    )
    assert summarise_recordings([]) == "0 recordings of 0 sensors."


def test_recompute_command_includes_the_settings_of_the_run() -> None:
    target = "results/recordings/imu/r/scores.parquet"
    plain = of(recording_rows("imu", "r"))
    assert plain.again(plain.views[0], "scores") == (f"snakemake -c2 --forcerun ingest -- {target}")
    other = of(recording_rows("imu", "r"), given=["logs=my logs", "simulated=false"])
    assert other.again(other.views[0], "scores") == (
        f"snakemake -c2 --config 'logs=my logs' simulated=false --forcerun ingest -- {target}"
    )


def test_sensors_of_one_vendor_and_model_are_told_apart() -> None:
    described = {
        name: {"vendor": "V", "model": model}
        for name, model in (("a", "1"), ("b", "1"), ("c", "2"))
    }
    names = name_sensors("abcd", described)
    assert names == {"a": "V 1 (a)", "b": "V 1 (b)", "c": "V 2", "d": "d"}
