# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What becomes of a sample that the driver hands to the estimator, and the rule that decides it.

The firmware reports none of this. Rules by which a sample is refused at once are exact. What happens to it later
depends on the instant at which the horizon reaches it, which is modelled: these codes begin with ``model_``.
"""

from typing import Final, NamedTuple

from ap_core.verdict import Rule

_MEASUREMENTS: Final = "AP_NavEKF3_Measurements.cpp, NavEKF3_core::"
_POS_VEL: Final = "AP_NavEKF3_PosVelFusion.cpp, NavEKF3_core::"
_MAG: Final = "AP_NavEKF3_MagFusion.cpp, NavEKF3_core::"
_BUFFER: Final = "EKF_Buffer.cpp, ekf_ring_buffer::"

TAKEN: Final = Rule("taken", "put into the buffer of the estimator", _MEASUREMENTS + "writeExtNavData")
NOT_STARTED: Final = Rule("not_started", "the estimator does not run yet", "AP_NavEKF3.cpp, NavEKF3::writeExtNavData")
NOT_A_NUMBER: Final = Rule("nan", "position, velocity or error is not a number", _MEASUREMENTS + "writeExtNavData")
YAW_NOT_A_NUMBER: Final = Rule("yaw_nan", "attitude is not a number; position taken", _MEASUREMENTS + "writeExtNavData")
TOO_SOON: Final = Rule("too_soon", "less than 20 ms, odometry 50 ms, after the last", _MEASUREMENTS + "writeExtNavData")
TOO_SHORT: Final = Rule(
    "too_short", "odometry over less than a step of the estimator", _MEASUREMENTS + "writeBodyFrameOdom"
)
NOT_INITIALISED: Final = Rule("not_initialised", "the estimator has no state yet", _MEASUREMENTS + "writeExtNavData")
NO_BUFFER: Final = Rule(
    "no_buffer", "no source set named external navigation at boot", "AP_NavEKF3_core.cpp, NavEKF3_core::setup_core"
)
OVERWRITTEN: Final = Rule("model_overwritten", "the buffer was full; the oldest sample gave way", _BUFFER + "push")
SUPERSEDED: Final = Rule("model_superseded", "a newer sample came due in the same step", _BUFFER + "recall")
TOO_OLD: Final = Rule("model_too_old", "100 ms or more behind the horizon", _BUFFER + "recall")
NOT_FINITE: Final = Rule("model_not_finite", "infinite, which no gate lets through", _POS_VEL + "FuseVelPosNED")
UNUSED: Final = Rule(
    "model_unused",
    "not used: its source is not in use, or the estimator is not ready for it",
    _POS_VEL + "SelectVelPosFusion",
)
FUSED: Final = Rule("model_fused", "used by the estimator", _POS_VEL + "FuseVelPosNED")
RESET_TO: Final = Rule("model_reset", "the estimator was reset to it", _POS_VEL + "ResetPosition")
GATE_POSITION: Final = Rule("model_gate_position", "rejected: horizontal position gate", _POS_VEL + "FuseVelPosNED")
GATE_VELOCITY: Final = Rule("model_gate_velocity", "rejected: velocity gate", _POS_VEL + "FuseVelPosNED")
GATE_HEIGHT: Final = Rule("model_gate_height", "rejected: height gate", _POS_VEL + "FuseVelPosNED")
GATE_YAW: Final = Rule("model_gate_yaw", "rejected: yaw gate, in flight", _MAG + "fuseEulerYaw")
GATE_ODOMETRY: Final = Rule(
    "model_gate_odometry", "rejected: body odometry gate, on an axis", _POS_VEL + "SelectBodyOdomFusion"
)
ALIGNED_TO: Final = Rule("model_aligned", "yaw was set to it", _MAG + "alignYawAngle")

RULES: Final = (
    TAKEN,
    NOT_STARTED,
    NOT_A_NUMBER,
    YAW_NOT_A_NUMBER,
    TOO_SOON,
    TOO_SHORT,
    NOT_INITIALISED,
    NO_BUFFER,
    OVERWRITTEN,
    SUPERSEDED,
    TOO_OLD,
    NOT_FINITE,
    UNUSED,
    FUSED,
    RESET_TO,
    ALIGNED_TO,
    GATE_POSITION,
    GATE_VELOCITY,
    GATE_HEIGHT,
    GATE_YAW,
    GATE_ODOMETRY,
)
"""All of them, by their numbers in `ekf_stub.core.events`."""

KINDS: Final = ("pose", "height", "yaw", "velocity", "odometry")
"""Kinds of samples, by their numbers there."""


class FilterOutcome(NamedTuple):
    """What the estimator did with a sample: took or refused it as it came and, by the model, what came of it later.

    Attributes:
        kind: ``pose`` (its north and east), ``height`` (its down), ``yaw``, ``velocity`` or ``odometry``.
        rule: what decided it, one of ``RULES``.
        time_ms: when it was observed, in ms since boot.
        ratio: of its innovation to the gate, where it was tested.
        innovation: the length of that innovation, likewise: m, deg or m/s; of a pose horizontal.
    """

    kind: str
    rule: Rule
    time_ms: int
    ratio: float | None
    innovation: float | None = None
