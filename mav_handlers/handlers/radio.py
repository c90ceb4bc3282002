# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The handler of the pilot's radio over MAVLink."""

from typing import Final

from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.verdicts import HANDLED, NOT_ACCEPTED
from mav_handlers.wire.messages import RC_CHANNELS_OVERRIDE

IGNORED_PWM: Final = 65535
"""A channel of this pulse length stays as it is."""
RELEASED_PWM: Final = 0
"""A channel of this pulse length goes back to the radio."""
_EXTENDED_RELEASED: Final = 65534


def handle_rc_channels_override(ctx: Context, message: RC_CHANNELS_OVERRIDE) -> Verdict:
    """Override the radio's channels, if the sender is the ground station in charge."""
    if not ctx.vehicle.release.params.is_ground_station(ctx.vehicle.params, ctx.header.system_id):
        return NOT_ACCEPTED
    ctx.vehicle.copter.receiver.override(
        (
            *(message.chan1_raw, message.chan2_raw, message.chan3_raw, message.chan4_raw),
            *(message.chan5_raw, message.chan6_raw, message.chan7_raw, message.chan8_raw),
            *map(_extended, (message.chan9_raw, message.chan10_raw, message.chan11_raw, message.chan12_raw)),
            *map(_extended, (message.chan13_raw, message.chan14_raw, message.chan15_raw, message.chan16_raw)),
        )
    )
    return HANDLED


def _extended(pwm_us: int) -> int:
    """Return an extended channel in the meaning of the first eight: 0 leaves it as it is, 65534 gives it back."""
    if pwm_us == RELEASED_PWM:
        return IGNORED_PWM
    return RELEASED_PWM if pwm_us == _EXTENDED_RELEASED else pwm_us
