# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What parameters ask of the firmware, for the most part of its estimator, that is not done here."""

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

_GPS_COMPASS_FALLBACK: Final = 3.0
_BEACON: Final = 4.0
_WHEEL_ENCODER: Final = 7.0
_EXTERNAL: Final = 11.0
_SETS: Final = ("1", "2", "3")


class LeftOut(NamedTuple):
    """A part of the firmware that is not done here.

    Attributes:
        what: its name.
        line: what a user is told who asks for it.
        asked_by: the value of each parameter that asks for it, 0 for any above 0; SRCn stands for all source sets.
        is_of_estimator: whether it belongs to the estimator.
    """

    what: str
    line: str
    asked_by: Mapping[str, float]
    is_of_estimator: bool = True

    def parameters(self) -> Iterator[tuple[str, float]]:
        """Yield each parameter that may ask for it, with the value that does, 0 for any above 0."""
        for name, value in self.asked_by.items():
            sets = _SETS if "SRCn" in name else ("",)
            yield from ((name.replace("SRCn", f"SRC{number}"), value) for number in sets)


LEFT_OUT: Final = (
    LeftOut(
        "range beacons",
        "range beacons are not fused here",
        {
            **dict.fromkeys((f"EK3_SRCn_{part}" for part in ("POSXY", "VELXY", "POSZ", "VELZ")), _BEACON),
            "BCN_TYPE": 0,
        },
    ),
    LeftOut("wheel encoders", "wheel encoders are not fused here", {"EK3_SRCn_VELXY": _WHEEL_ENCODER, "WENC_TYPE": 0}),
    LeftOut(
        "drag and wind",
        "drag is not fused, and wind not estimated here",
        dict.fromkeys(("EK3_DRAG_BCOEF_X", "EK3_DRAG_BCOEF_Y", "EK3_DRAG_MCOEF"), 0),
    ),
    LeftOut(
        "a compass that takes over",
        "a compass does not take over from a GPS that has lost its yaw",
        {"EK3_SRCn_YAW": _GPS_COMPASS_FALLBACK},
    ),
    LeftOut(
        "compasses by their heading alone",
        "EK3_MAG_CAL alone says when three axes of a compass are fused here",
        {"EK3_MAG_MASK": 0},
    ),
    LeftOut("airspeed", "airspeed is not fused here", {"ARSPD_TYPE": 0}),
    LeftOut("EKF2", "there is no EKF2 here", {"EK2_ENABLE": 0}),
    LeftOut("External AHRS", "there is no External AHRS here", {"EAHRS_TYPE": 0, "AHRS_EKF_TYPE": _EXTERNAL}),
    LeftOut("wind", "there is no wind here", {"SIM_WIND_SPD": 0}, is_of_estimator=False),
    LeftOut("fences", "the vehicle does not keep to fences here", {"FENCE_ENABLE": 0}, is_of_estimator=False),
)


def line_about(name: str) -> str | None:
    """Return what a user is told whose parameter may ask for what there is not; None for other parameters."""
    return next((row.line for row in LEFT_OUT for known, _ in row.parameters() if known == name), None)


def left_out(params: Mapping[str, float], *, of_estimator: bool = False) -> tuple[str, ...]:
    """Return what parameters, by name, ask for in vain, a line each; ``of_estimator`` asks for its parts alone."""
    return tuple(
        f"{name} is {params[name]:g}: {row.line}"
        for row in LEFT_OUT
        for name, value in row.parameters()
        if row.is_of_estimator or not of_estimator
        if name in params and (params[name] == value if value else params[name] > 0)
    )
