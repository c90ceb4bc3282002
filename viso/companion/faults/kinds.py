# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of faults by their names in a timeline, one row each.

A kind that ArduPilot's simulator has is named as its parameter, without SIM_VICON_.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from viso.companion.faults.contents import Covariance, Distance, FrameIds, Looks, NotANumber, Quality
from viso.companion.faults.fault import Fault
from viso.companion.faults.motion import (
    Degrees,
    Drift,
    FrameYaw,
    Frozen,
    PositionGlitch,
    PositionNoise,
    QuatNorm,
    QuatXyzw,
    Reset,
    Scale,
    SensorPlace,
    VelocityGlitch,
    VelocityNoise,
    YawError,
)
from viso.companion.faults.stamps import ClockDrift, ClockStep, StampConstant, StampInUnit
from viso.companion.faults.transport import (
    Blackout,
    Bunch,
    Corrupt,
    Delay,
    Duplicate,
    Fail,
    Jitter,
    Loss,
    Mavlink1,
    Rate,
    Reorder,
    SecondSender,
    SenderId,
)
from viso.companion.faults.wrong_axes import WrongAxes

FAULTS: Final[Mapping[str, type[Fault]]] = MappingProxyType(
    {
        "fail": Fail,
        "blackout": Blackout,
        "loss": Loss,
        "rate": Rate,
        "delay": Delay,
        "jitter": Jitter,
        "bunch": Bunch,
        "reorder": Reorder,
        "duplicate": Duplicate,
        "corrupt": Corrupt,
        "mavlink1": Mavlink1,
        "sender_id": SenderId,
        "second_sender": SecondSender,
        "clock_step": ClockStep,
        "clock_drift": ClockDrift,
        "stamp_unit": StampInUnit,
        "stamp_constant": StampConstant,
        "glit": PositionGlitch,
        "vgli": VelocityGlitch,
        "p_sd": PositionNoise,
        "v_sd": VelocityNoise,
        "pos": SensorPlace,
        "yaw": FrameYaw,
        "yawerr": YawError,
        "drift": Drift,
        "scale": Scale,
        "axes": WrongAxes,
        "frozen": Frozen,
        "reset": Reset,
        "degrees": Degrees,
        "quat_xyzw": QuatXyzw,
        "quat_norm": QuatNorm,
        "frame_ids": FrameIds,
        "quality": Quality,
        "distance": Distance,
        "looks": Looks,
        "nan": NotANumber,
        "covariance": Covariance,
    }
)
