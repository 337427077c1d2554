"""The sensor files that ship: complete, as printed, and with evidence for what they claim."""

import re
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Any

import pytest
import yaml

from imubench_pipeline.datasheets.comparable import read_comparables
from imubench_pipeline.datasheets.suspicion import printed_figures, suspicious, usual_figures
from imubench_pipeline.settings.printed import (
    FIGURE_DIMENSIONS,
    PrintedFigure,
    compute_noise_bandwidth,
    convert_density,
    noise_of_rms,
)
from imubench_pipeline.settings.sensor import QUANTITIES, Sensor, read_sensors
from imubench_pipeline.units import convert_to_si
from tests.conftest import PROJECT

FOLDER = PROJECT / "config/sensors"
CATALOGUE = read_sensors(FOLDER)

# model as the collection of facts names it -> sensor file
FILES = {
    "MPU-9250": "mpu9250",
    "MPU-6050": "mpu6050",
    "ICM-20948": "icm20948",
    "ICM-42688-P": "icm42688_p",
    "ICM-20602": "icm20602",
    "ICM-40609-D (Livox Mid-360)": "icm40609_d",
    "BNO055": "bno055",
    "BMI088": "bmi088",
    "BMI270": "bmi270",
    "BMI160": "bmi160",
    "BMI055 (RealSense D435i/D455)": "bmi055",
    "LSM6DSV16X": "lsm6dsv16x",
    "LSM6DSO": "lsm6dso",
    "ISM330DHCX": "ism330dhcx",
    "ASM330LHH": "asm330lhh",
    "ADIS16405": "adis16405",
    "ADIS16448": "adis16448",
    "ADIS16460 (bonus)": "adis16460",
    "ADIS16470": "adis16470",
    "ADIS16495-1": "adis16495_1",
    "ADIS16488": "adis16488",
    "MTi-1 series incl. MTi-7": "mti_7",
    "MTi-300 (bonus)": "mti_300",
    "C102-F9R (ZED-F9R internal IMU)": "c102_f9r",
    "STIM300": "stim300",
    "HG4930": "hg4930",
    "VN-100": "vn_100",
    "OpenIMU300": "openimu300",
    "SCC2130-D08": "scc2130",
    "SCHA63T": "scha63t",
    "LN-200": "ln_200",
    "SiRRS01-03": "sirrs01_03",
}
KEYS = {
    "arw": "random_walk",
    "vrw": "random_walk",
    "rms_noise_low_frequency": "rms_noise",
    "adev_600s": "allan_deviation",
    "max_drift": "drift",
    "zero_rate_offset": "offset",
    "zero_g_offset": "offset",
    "bias_run_run": "bias_repeatability",
    "tempco_offset": "temperature_coefficient",
    "zero_g_tempco": "temperature_coefficient",
    "zero_rate_over_temperature": "temperature_total",
    "zero_g_over_temperature": "temperature_total",
    "bias_over_temperature": "temperature_rms",
}
NOT_THE_VENDORS = {"measured_N", "measured_B", "noise_density_si_in_paper", "rms_noise_statement"}


def figures(sensor: Sensor) -> list[tuple[str, str, PrintedFigure]]:
    return [
        (quantity, name, figure)
        for quantity in QUANTITIES
        if (sheet := getattr(sensor.datasheet, quantity))
        for name in FIGURE_DIMENSIONS[quantity]
        for figure in sheet.printed(name)
    ]


@lru_cache(maxsize=1)
def facts(shared: Path) -> dict[str, dict[str, Any]]:
    listed = yaml.safe_load((shared / "facts/datasheets.yaml").read_text())["sensors"]
    return {FILES[entry["model"]]: entry for entry in listed}


def numbers(value: Any) -> list[float]:
    """Every number of a figure, whichever way axes, options or ranges are written."""
    if isinstance(value, dict):
        return sorted(float(v) for v in value.values())
    if isinstance(value, (list, tuple)):
        return sorted(float(v) for v in value)
    return [float(value)]


def found_as(sensor: Sensor, quantity: str, fact: dict[str, Any]) -> list[PrintedFigure]:
    """The figures of a sensor file that a fact stands in, by key and unit."""
    sheet = getattr(sensor.datasheet, quantity)
    key = KEYS.get(fact["quantity"], fact["quantity"])
    # A unit by count, or counts by unit, is the sensitivity, though vendors call it a resolution.
    key = "sensitivity" if key == "resolution" and "LSB" in fact["unit"] else key
    listed = sheet.printed(key)
    return [each for each in listed if each.unit == fact["unit"]]


NO_PRODUCTS = {"scc2130_x25", "sirrs01_03_triad"}
"""What the demonstration makes of several sensors."""


def test_every_sensor_of_the_facts_has_a_file(shared: Path) -> None:
    assert set(FILES.values()) == set(facts(shared))
    assert set(CATALOGUE) >= set(FILES.values()) | {"cats_tag", *NO_PRODUCTS}
    assert {name for name, sensor in CATALOGUE.items() if not sensor.sold} == NO_PRODUCTS


@pytest.mark.parametrize("name", FILES.values())
def test_figures_are_as_printed(shared: Path, name: str) -> None:
    sensor, entry = CATALOGUE[name], facts(shared)[name]
    for quantity in QUANTITIES:
        for fact in entry.get(quantity, []):
            if fact["quantity"] in NOT_THE_VENDORS or fact["kind"] == "derived":
                continue
            if fact["value"] is None:
                sheet = getattr(sensor.datasheet, quantity)
                keys = [fact["quantity"]]
                if fact["quantity"] == "any_noise_parameter":
                    keys = ["noise_density", "random_walk", "bias_instability"]
                for key in keys:
                    assert sheet.looked_up(key) and not sheet.printed(key), (quantity, key)
                continue
            if (name, quantity, fact["quantity"]) == ("icm20602", "gyro", "bias_instability"):
                assert "not the vendor" in fact["condition"]
                continue
            listed = found_as(sensor, quantity, fact)
            assert listed, (quantity, fact)
            alike = [each for each in listed if each.kind in (fact["kind"], "choices", "range")]
            printed = [v for each in alike for v in numbers(each.value)]
            for number in numbers(fact["value"]):
                assert number in printed, (quantity, fact)
            if isinstance(fact["value"], dict):
                for where, number in fact["value"].items():
                    assert (where_said(where), float(number)) in placed(alike), (quantity, fact)
            source = {each.source or sensor.datasheet.source for each in listed}
            # A figure that is quoted in the facts may have been read in the document since.
            assert source & {fact["evidence"], "primary"}, (quantity, fact)


def where_said(where: str) -> str:
    """Return the axis, range or grade of a fact (XY, 5g, S-class) as sensor files write it."""
    return re.sub(r"(?<=\d)g$", " g", where) if set(where) - set("XYZ") else where.lower()


def placed(listed: list[PrintedFigure]) -> set[tuple[str | None, float]]:
    """Every number of some figures with the axes or the option that it is printed for."""
    found: set[tuple[str | None, float]] = set()
    for each in listed:
        if isinstance(each.value, dict):
            found |= {(axes, value) for axes, value in each.value.items()}
        elif isinstance(each.value, float):
            found.add((each.option, each.value))
    return found


@pytest.mark.parametrize("name", FILES.values())
def test_no_figure_is_invented(shared: Path, name: str) -> None:
    """Every number is in the facts of its quantity, or names its place in the document."""
    entry = facts(shared)[name]
    for quantity, key, figure in figures(CATALOGUE[name]):
        if figure.place or figure.evidence:
            continue
        known = [fact for fact in entry.get(quantity, []) if fact["value"] is not None]
        values = [v for fact in known for v in numbers(fact["value"])]
        said = " ".join(str(fact.get("condition", "")) for fact in known)
        values += [float(text) for text in re.findall(r"\d+\.?\d*", said)]
        for number in numbers(figure.value):
            assert abs(number) in values, (quantity, key, number)


@pytest.mark.parametrize("name", CATALOGUE)
def test_every_file_says_where_its_figures_are_from(name: str) -> None:
    sensor = CATALOGUE[name]
    assert sensor.datasheet.document
    if figures(sensor):
        assert sensor.datasheet.source in ("primary", "secondary")


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_side_is_stated_with_its_arithmetic(name: str) -> None:
    """Beside a one-sided density stands a random walk, or an rms, that agrees with it alone."""
    listed = figures(CATALOGUE[name])
    for quantity, key, figure in listed:
        if key != "noise_density" or figure.sidedness == "unknown":
            continue
        assert figure.evidence and "sqrt" in figure.evidence
        sides = set()
        for axis in "xyz":
            density = figure.on_axis(axis)
            assert isinstance(density, float)
            si = convert_to_si(density, figure.unit or "", f"{quantity}_density")
            for other_quantity, other_key, other in listed:
                value = other.on_axis(axis)
                if (
                    other_quantity != quantity
                    or not isinstance(value, float)
                    or other.kind != "typ"
                ):
                    continue
                if other_key == "random_walk":
                    N = convert_to_si(value, other.unit or "", f"{quantity}_density")
                elif other_key == "rms_noise" and other.bandwidth_hz:
                    rms = convert_to_si(value, other.unit or "", QUANTITIES[quantity])
                    N = noise_of_rms(rms, compute_noise_bandwidth(other.bandwidth_hz, other.filter))
                else:
                    continue
                for side in ("one-sided", "two-sided"):
                    if convert_density(si, side) == pytest.approx(N, rel=0.05):
                        sides.add(side)
        assert figure.sidedness in sides


def test_a_density_that_fits_neither_side_is_of_unknown_side() -> None:
    gyro = CATALOGUE["adis16448"].datasheet.gyro
    assert gyro is not None
    (figure,) = gyro.printed("noise_density")
    assert figure.sidedness == "unknown" and "fits neither" in (figure.evidence or "")


def test_no_shipped_figure_is_suspicious() -> None:
    usual = usual_figures(CATALOGUE)
    for sensor in CATALOGUE.values():
        for quantity in QUANTITIES:
            assert suspicious(quantity, printed_figures(sensor, quantity), usual) == []


def test_every_option_that_is_set_is_one_of_the_figures() -> None:
    for name, sensor in CATALOGUE.items():
        known = {figure.option for _, _, figure in figures(sensor)}
        assert set(sensor.datasheet.options) <= known, name


KEYS_OF_FILE = (
    *("vendor", "model", "aliases", "grade", "technology", "price_class", "price", "sold"),
    *("mass", "power", "temperature_range", "rate", "interface", "log", "datasheet"),
)

SOLD = [name for name, sensor in CATALOGUE.items() if sensor.sold and name != "cats_tag"]


@pytest.mark.parametrize("name", SOLD)
def test_each_product_has_a_class_and_each_figure_a_source(name: str) -> None:
    sensor = CATALOGUE[name]
    sheet = sensor.datasheet
    assert sensor.grade and (sensor.technology or sheet.missing)
    assert sheet.source or sheet.missing
    for quantity in QUANTITIES:
        own = getattr(sheet, quantity)
        for key in FIGURE_DIMENSIONS[quantity] if own else ():
            for figure in getattr(own, key) or ():
                assert figure.value is not None or figure.place, (quantity, key)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_density_agrees_with_the_random_walk_beside_it(name: str) -> None:
    """Within 5 % on one side, unless the file says that they disagree."""
    for quantity in QUANTITIES:
        rows = list(read_comparables(CATALOGUE[name].datasheet, f"{quantity}_x"))
        rows = [row for row in rows if row.statistic == "N" and row.value and not row.is_rms]
        rows = [row for row in rows if row.figure and row.figure.kind == "typ"]
        walks = [row for row in rows if row.sidedness is None]
        for option in {row.figure.option for row in walks if row.figure}:
            sides = [r for r in rows if r.sidedness and r.figure and r.figure.option == option]
            own = [r for r in walks if r.figure and r.figure.option == option]
            explained = any((r.figure.evidence or r.figure.source) for r in (*sides, *own))
            if sides and own and not explained:
                ratios = [a.value / b.value for a in sides for b in own]
                assert any(0.95 <= ratio <= 1.05 for ratio in ratios), (quantity, option, ratios)


def test_no_two_sensors_share_a_document_without_saying_so() -> None:
    documents = Counter(
        (sensor.datasheet.document, sensor.datasheet.revision)
        for sensor in CATALOGUE.values()
        if sensor.sold and sensor.datasheet.source == "primary"
    )
    shared = [document for document, count in documents.items() if count > 1]
    assert shared == []


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.yaml")), ids=lambda path: path.stem)
def test_files_are_laid_out_alike(path: Path) -> None:
    text = path.read_text()
    keys = list(yaml.safe_load(text))
    assert keys == [key for key in KEYS_OF_FILE if key in keys]
    assert {"vendor", "model", "log", "datasheet"} <= set(keys)
    assert path.stem == path.stem.lower()
    assert max(map(len, text.splitlines())) <= 100
