"""Factors from SI, from other constants than the package's own tables of units."""

DEGREES = 57.29577951308232  # in a radian
ARC = 206264.80624709636  # seconds of arc in a radian: degrees an hour in a radian a second
MICRO_G = 101971.62129779283  # in a metre a second squared

_ANY = {"T_B": ("s", 1.0), "tau_min": ("s", 1.0)}
FACTORS: dict[str, dict[str, dict[str, tuple[str, float]]]] = {
    "gyro": {
        "°/h and °/√h": _ANY | {
            "N": ("°/√h", 60 * DEGREES), "B": ("°/h", ARC), "K": ("°/h/√h", 60 * ARC),
            "adev": ("°/h", ARC), "signal": ("°/s", DEGREES), "psd": ("°/s/√Hz", DEGREES),
        },
        "°/s": _ANY | {
            "N": ("°/s/√Hz", DEGREES), "B": ("°/s", DEGREES), "K": ("°/s/√s", DEGREES),
            "adev": ("°/s", DEGREES), "signal": ("°/s", DEGREES), "psd": ("°/s/√Hz", DEGREES),
        },
        "SI: rad/s": _ANY | {
            "N": ("rad/s/√Hz", 1.0), "B": ("rad/s", 1.0), "K": ("rad/s/√s", 1.0),
            "adev": ("rad/s", 1.0), "signal": ("rad/s", 1.0), "psd": ("rad/s/√Hz", 1.0),
        },
    },
    "accel": {
        "µg and µg/√Hz": _ANY | {
            "N": ("µg/√Hz", MICRO_G), "B": ("µg", MICRO_G), "K": ("µg/√h", 60 * MICRO_G),
            "adev": ("µg", MICRO_G), "signal": ("mg", MICRO_G / 1e3), "psd": ("µg/√Hz", MICRO_G),
        },
        "mg and m/s/√h": _ANY | {
            "N": ("m/s/√h", 60.0), "B": ("mg", MICRO_G / 1e3), "K": ("mg/√h", 60 * MICRO_G / 1e3),
            "adev": ("mg", MICRO_G / 1e3), "signal": ("mg", MICRO_G / 1e3),
            "psd": ("mg/√Hz", MICRO_G / 1e3),
        },
        "SI: m/s²": _ANY | {
            "N": ("m/s²/√Hz", 1.0), "B": ("m/s²", 1.0), "K": ("m/s²/√s", 1.0),
            "adev": ("m/s²", 1.0), "signal": ("m/s²", 1.0), "psd": ("m/s²/√Hz", 1.0),
        },
    },
}  # fmt: skip
for _choices in FACTORS.values():
    for _units in _choices.values():
        _units |= {"B_curve": _units["B"], "sigma_min": _units["B"]}
"""Quantity -> choice of the reader -> symbol -> sign of the unit, and factor from SI."""
