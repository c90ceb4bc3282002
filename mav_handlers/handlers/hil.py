# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of the messages by which a simulator gives the vehicle its sensors; the firmware has none."""

from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.verdicts import HANDLED, NO_HIL_INPUT
from mav_handlers.wire.messages import HIL_SENSOR, HIL_STATE_QUATERNION


def handle_hil_sensor(ctx: Context, message: HIL_SENSOR) -> Verdict:
    """Give a simulator's sensors to the vehicle that takes them."""
    if ctx.vehicle.hil is None:
        return NO_HIL_INPUT
    ctx.vehicle.hil.take_hil_sensor(message, ctx.now_us)
    return HANDLED


def handle_hil_state_quaternion(ctx: Context, message: HIL_STATE_QUATERNION) -> Verdict:
    """Give a simulator's truth to the vehicle that makes its sensors of it."""
    if ctx.vehicle.hil is None:
        return NO_HIL_INPUT
    ctx.vehicle.hil.take_hil_state(message, ctx.now_us)
    return HANDLED
