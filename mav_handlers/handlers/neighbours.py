# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers of the messages of other sensors and programs beside external navigation.

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
    """Give a solution to the GPS that takes it; the vehicle has one place for a GPS, number 0."""
    if message.gps_id != 0:
        return GPS_OTHER_INSTANCE
    return HANDLED if ctx.vehicle.gps.take(message) else GPS_NOT_MAVLINK


def handle_optical_flow(ctx: Context, message: OPTICAL_FLOW) -> Verdict:
    """Give flow to the sensor that takes it; the time of arrival counts, not ``time_usec``."""
    return HANDLED if ctx.vehicle.flow.take(message) else NO_FLOW_SENSOR


def handle_landing_target(ctx: Context, message: LANDING_TARGET) -> Verdict:
    """Correct the time stamp, with the corrector that external navigation on this link shares; that is all here."""
    ctx.correct_time_ms(LANDING_TARGET, message.time_usec)
    return NO_PRECISION_LANDING


def handle_distance_sensor(ctx: Context, message: DISTANCE_SENSOR) -> Verdict:
    """Give a distance to the range finders that look where it is measured; there are no proximity sensors."""
    return HANDLED if ctx.vehicle.ranges.take(message) else NO_RANGEFINDER


def handle_adsb_vehicle(_ctx: Context, _message: ADSB_VEHICLE) -> Verdict:
    """Drop an aircraft; routing has sent it on to the other links."""
    return ADSB_OFF


def handle_named_value_float(ctx: Context, message: NAMED_VALUE_FLOAT) -> Verdict:
    """Log a named value, with its sender."""
    sender = ctx.header.system_id, ctx.header.component_id
    ctx.vehicle.log.named_value(message.time_boot_ms, message.name, message.value, *sender)
    return HANDLED


def handle_hil_sensor(ctx: Context, message: HIL_SENSOR) -> Verdict:
    """Give a simulator's sensors to the vehicle that takes them."""
    return HANDLED if ctx.vehicle.source.take_hil_sensor(message, ctx.now_us) else NO_HIL_INPUT


def handle_hil_state_quaternion(ctx: Context, message: HIL_STATE_QUATERNION) -> Verdict:
    """Give a simulator's truth to the vehicle that makes its sensors of it."""
    return HANDLED if ctx.vehicle.source.take_hil_state(message, ctx.now_us) else NO_HIL_INPUT
