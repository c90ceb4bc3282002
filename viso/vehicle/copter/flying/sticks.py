# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pilot's sticks, which a client moves with RC_CHANNELS_OVERRIDE.

Source: RC_Channel/RC_Channels.cpp, RC_Channel/RC_Channel.cpp (get_override), GCS_Common.cpp
(handle_rc_channels_override).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

from ap_core.clock import Clock
from ap_core.param import ParamTable

OVERRIDE_US: Final = 3_000_000
"""RC_OVERRIDE_TIME's default."""
NEUTRAL_PWM: Final = 1500
SPAN_PWM: Final = 400.0
DEAD_ZONE: Final = 0.075
IGNORED: Final = 65535
RELEASED: Final = 0


class Sticks(NamedTuple):
    """Deflections -1..1: roll to the right, pitch with the nose up, throttle up of its middle, yaw to the right."""

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0


CENTRED: Final = Sticks()


class PilotSticks:
    """Sticks that are centred unless they are overridden: there is no radio."""

    def __init__(self, params: ParamTable, clock: Clock) -> None:
        self._params = params
        self._clock = clock
        self._overrides: dict[int, tuple[int, int]] = {}

    def override(self, pwm: Sequence[int]) -> None:
        """Move sticks: pulse lengths in us by channel from 1 on; 65535 leaves a channel as it is, 0 releases it."""
        for channel, value in enumerate(pwm, start=1):
            if value == RELEASED:
                self._overrides.pop(channel, None)
            elif value != IGNORED:
                self._overrides[channel] = value, self._clock.micros64()

    def now(self) -> Sticks:
        """Return where the sticks are."""
        if not self._overrides:
            return CENTRED
        return Sticks(*(self._deflection(name) for name in ("ROLL", "PITCH", "THROTTLE", "YAW")))

    def _deflection(self, name: str) -> float:
        pwm, moved_us = self._overrides.get(self._params.get_int(f"RCMAP_{name}"), (NEUTRAL_PWM, 0))
        if self._clock.micros64() - moved_us > OVERRIDE_US:
            return 0.0
        deflection = min(max((pwm - NEUTRAL_PWM) / SPAN_PWM, -1.0), 1.0)
        return 0.0 if abs(deflection) < DEAD_ZONE else deflection
