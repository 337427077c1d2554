"""The noise of a sensor by its datasheet alone, for the file of a program."""

from imubench_pipeline.datasheets.printed_noise import PrintedNoise, read_printed_noise
from imubench_pipeline.extensions.exports.imu import AxisNoise, ExportError, Imu
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.units import parse_quantity

_CAUTION = "these are figures of a datasheet and of its class, and not of a log"
_NAMES = {
    "N": "N, the two-sided density: a one-sided density over sqrt(2), or the random walk",
    "flicker": "B: the printed bias instability is the lowest point of the curve, 0.664 B",
    "K": "K: the random walk",
}


def build_printed_imu(
    name: str,
    sensor: Sensor,
    *,
    horizon: float = 60.0,
    inflation: float = 1.0,
    because: str | None = None,
    rate: float | None = None,
) -> Imu:
    """Return the noise of a sensor by its datasheet, with missing figures the worst of the class.

    ``horizon`` is in s, ``rate`` in Hz, by default the highest of the sensor. Raises ExportError
    without a rate.
    """
    if rate is None and sensor.rate is None:
        raise ExportError(f"the sensor file of {name} states no rate; add the rate (--rate)")
    sheet = sensor.datasheet
    document = ", ".join(filter(None, (sheet.document, sheet.revision))) or "its sensor file"
    axes = {
        quantity: _make_axis(read_printed_noise(sensor, quantity), document)
        for quantity in ("gyro", "accel")
        if getattr(sheet, quantity) is not None
    }
    return Imu(
        sensor=f"{sensor.vendor} {sensor.model}",
        rate=rate or parse_quantity(sensor.rate or "", "frequency"),
        estimated=axes,
        horizon=horizon,
        inflation=inflation,
        because=because,
        simulated=False,
        cautions=(_CAUTION,),
    )


def _make_axis(noise: PrintedNoise, document: str) -> AxisNoise:
    notes = []
    for source, meaning in _NAMES.items():
        if source not in noise.assumed:
            notes.append(f"{meaning}; PRINTED, not measured")
        elif source == "K":
            notes.append(
                f"{meaning} is NOT PRINTED: as large as the bias instability after 500 s, the "
                "earliest of four published sensors"
            )
        else:
            notes.append(f"{meaning}; NOT PRINTED: the worst of its class")
    return AxisNoise(noise.models["in_use"], f"datasheet {document}", notes)
