# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of messages from other sensors and programs.

The firmware has no handler of the HIL messages.
Source: GCS_MAVLink/GCS_Common.cpp (handle_message, handle_optical_flow, handle_landing_target, handle_distance_sensor,
handle_adsb_message, handle_named_value), AP_GPS/AP_GPS.cpp (handle_msg).
"""

from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.verdicts import (
    ADSB_OFF,
    GPS_NOT_MAVLINK,
    GPS_OTHER_INSTANCE,
    HANDLED,
    NO_FLOW_SENSOR,
    NO_HIL_INPUT,
    NO_PRECISION_LANDING,
    NO_RANGEFINDER,
)
from mav_handlers.wire.messages import (
    ADSB_VEHICLE,
    DISTANCE_SENSOR,
    GPS_INPUT,
    HIL_SENSOR,
    HIL_STATE_QUATERNION,
    LANDING_TARGET,
    NAMED_VALUE_FLOAT,
    OPTICAL_FLOW,
)


def handle_gps_input(ctx: Context, message: GPS_INPUT) -> Verdict:
    """Pass a solution to the MAVLink GPS of its number, 0 or 1."""
    if ctx.vehicle.gps.take(message):
        return HANDLED
    return GPS_NOT_MAVLINK if message.gps_id == 0 else GPS_OTHER_INSTANCE


def handle_optical_flow(ctx: Context, message: OPTICAL_FLOW) -> Verdict:
    """Pass flow to the MAVLink flow sensor; the time of arrival counts, not ``time_usec``."""
    return HANDLED if ctx.vehicle.flow.take(message) else NO_FLOW_SENSOR


def handle_landing_target(ctx: Context, message: LANDING_TARGET) -> Verdict:
    """Correct the time stamp with the link's corrector, which external navigation shares; nothing else happens."""
    ctx.correct_time_ms(LANDING_TARGET, message.time_usec)
    return NO_PRECISION_LANDING


def handle_distance_sensor(ctx: Context, message: DISTANCE_SENSOR) -> Verdict:
    """Pass a distance to the range finders with that orientation; there are no proximity sensors."""
    return HANDLED if ctx.vehicle.ranges.take(message) else NO_RANGEFINDER


def handle_adsb_vehicle(_ctx: Context, _message: ADSB_VEHICLE) -> Verdict:
    """Ignore an aircraft; routing has forwarded the message to the other links."""
    return ADSB_OFF


def handle_named_value_float(ctx: Context, message: NAMED_VALUE_FLOAT) -> Verdict:
    """Log a named value, with its sender."""
    sender = ctx.header.system_id, ctx.header.component_id
    ctx.vehicle.log.named_value(message.time_boot_ms, message.name, message.value, *sender)
    return HANDLED


def handle_hil_sensor(ctx: Context, message: HIL_SENSOR) -> Verdict:
    """Pass a simulator's sensor values to the vehicle."""
    return HANDLED if ctx.vehicle.source.take_hil_sensor(message, ctx.now_us) else NO_HIL_INPUT


def handle_hil_state_quaternion(ctx: Context, message: HIL_STATE_QUATERNION) -> Verdict:
    """Pass a simulator's true state to the vehicle, which derives sensor values from it."""
    return HANDLED if ctx.vehicle.source.take_hil_state(message, ctx.now_us) else NO_HIL_INPUT
