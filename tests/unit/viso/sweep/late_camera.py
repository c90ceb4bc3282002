# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that flies an eight, and a camera whose poses are late by a known time, as a script and a capture."""

import json
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from mav_handlers.wire.codec import Codec
from tests.unit.viso.conftest import odometry
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.script.script_file import parse_script
from viso.vehicle.sensors.source import ImuOptions

END_S: Final = 14.0
PARAMS: Final = {
    "VISO_TYPE": 1,
    "GPS1_TYPE": 0,
    "EK3_SRC1_POSXY": 6,
    "EK3_SRC1_VELXY": 6,
    "EK3_SRC1_POSZ": 6,
    "EK3_SRC1_VELZ": 6,
    "EK3_SRC1_YAW": 6,
}
SCRIPT: Final = """
start = 7.0
[[leg]]
shape = "figure_eight"
length_m = 16.0
width_m = 8.0
period_s = 6.0
laps = 1
"""
_FIRST_US: Final = 4_000_000
_PERIOD_US: Final = 40_000
_JITTER_US: Final = 37_000  # so that poses meet the filter's steps at all phases


class LateCamera(NamedTuple):
    """The files: the vehicle's motion, and what the camera sent."""

    script: Path
    capture: Path


def late_camera(folder: Path, delay_ms: float, end_s: float = END_S) -> LateCamera:
    """Write the files of a camera whose poses are late by some ms when they arrive; transport takes no time."""
    script, capture = folder / "eight.toml", folder / "late.jsonl"
    script.write_text(SCRIPT)
    vehicle = ScriptSource(ImuOptions(), parse_script(SCRIPT, "eight", 0.0))
    camera = Codec(1, 197)
    lines = [json.dumps({"name": "late", "params": PARAMS})]
    phase = np.random.default_rng(1).integers(0, _JITTER_US, 1000).tolist()
    for number, slot_us in enumerate(range(_FIRST_US, round(end_s * 1e6), _PERIOD_US)):
        arrival_us = slot_us + phase[number]
        seen = vehicle.truth(arrival_us - round(delay_ms * 1e3))
        vel = _in_body(seen.quat_wxyz, seen.vel_ned)
        message = odometry(
            arrival_us,
            **dict(zip("xyz", seen.pos_ned, strict=True)),
            **dict(zip(("vx", "vy", "vz"), vel, strict=True)),
            q=seen.quat_wxyz,
        )
        lines.append(json.dumps({"arrival_us": arrival_us, "msg": camera.encode(message).hex()}))
    capture.write_text("\n".join(lines) + "\n")
    return LateCamera(script, capture)


def _in_body(quat_wxyz: tuple[float, ...], vector: tuple[float, ...]) -> tuple[float, ...]:
    w, xyz, v = quat_wxyz[0], -np.array(quat_wxyz[1:]), np.array(vector)
    turned = v + 2 * np.cross(xyz, np.cross(xyz, v) + w * v)
    return tuple(turned.tolist())
