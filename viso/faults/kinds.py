# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of faults by their names in a timeline, one row each.

A kind that ArduPilot's simulator has is named as its parameter, without SIM_VICON_.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from viso.faults import contents, motion, stamps, transport, wrong_axes
from viso.faults.fault import Fault

FAULTS: Final[Mapping[str, type[Fault]]] = MappingProxyType(
    {
        "fail": transport.Fail,
        "blackout": transport.Blackout,
        "loss": transport.Loss,
        "rate": transport.Rate,
        "delay": transport.Delay,
        "jitter": transport.Jitter,
        "bunch": transport.Bunch,
        "reorder": transport.Reorder,
        "duplicate": transport.Duplicate,
        "corrupt": transport.Corrupt,
        "mavlink1": transport.Mavlink1,
        "sender_id": transport.SenderId,
        "second_sender": transport.SecondSender,
        "clock_step": stamps.ClockStep,
        "clock_drift": stamps.ClockDrift,
        "stamp_unit": stamps.StampInUnit,
        "stamp_constant": stamps.StampConstant,
        "glit": motion.PositionGlitch,
        "vgli": motion.VelocityGlitch,
        "p_sd": motion.PositionNoise,
        "v_sd": motion.VelocityNoise,
        "pos": motion.SensorPlace,
        "yaw": motion.FrameYaw,
        "yawerr": motion.YawError,
        "drift": motion.Drift,
        "scale": motion.Scale,
        "axes": wrong_axes.WrongAxes,
        "frozen": motion.Frozen,
        "reset": motion.Reset,
        "degrees": motion.Degrees,
        "quat_xyzw": motion.QuatXyzw,
        "quat_norm": motion.QuatNorm,
        "frame_ids": contents.FrameIds,
        "quality": contents.Quality,
        "distance": contents.Distance,
        "looks": contents.Looks,
        "nan": contents.NotANumber,
        "covariance": contents.Covariance,
    }
)
