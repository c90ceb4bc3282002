# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters that a replay cannot judge, because of the source of its vehicle's motion."""

from collections.abc import Iterable, Iterator
from typing import Final

from viso.vehicle.sensors.flight import Basis

OF_THE_STREAM: Final = ("VISO_DELAY_MS", "VISO_SCALE", "VISO_ORIENT", "VISO_POS_X", "VISO_POS_Y", "VISO_POS_Z")
"""The parameters that relate a stream to the vehicle's own motion."""

_UNMOVED: Final = {
    "follow": "the vehicle moves as the stream says, whatever this is",
    "bench": "the vehicle stands still, whatever the stream says",
}
_HINT: Final = "--imu log:FLIGHT.BIN takes the motion of a flight"


def unobservable(name: str, imu: str) -> str | None:
    """Return why a parameter cannot be judged with a source of inertial data, as of ``--imu``; None if it can."""
    kind = imu.partition(":")[0]
    if name not in OF_THE_STREAM or kind not in _UNMOVED:
        return None
    return f"with --imu {kind} {_UNMOVED[kind]}; {_HINT}"


def caution(name: str, basis: Basis | None) -> str | None:
    """Return the reason for caution about a result for a parameter; None without one.

    ``basis`` is the source of the vehicle's motion; None for anything but a log.
    """
    if name in OF_THE_STREAM and basis is Basis.ESTIMATE:
        return "the motion is what the filter believed in flight, so what fits best leans to the value of that flight"
    if name == "VISO_SCALE" and basis is not None:
        return "it scales positions, not velocities: where both are fused, what fits best makes them agree"
    return None


def doubts(names: Iterable[str], imu: str, basis: Basis | None) -> Iterator[str]:
    """Yield a line for each parameter that cannot be judged, or not without caution."""
    for name in names:
        if reason := unobservable(name, imu):
            yield f"{name} cannot be judged: {reason}"
        elif reason := caution(name, basis):
            yield f"{name}: {reason}"
