# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The receiver of the pilot's radio, whose channels a ground station can override.

Source: RC_Channel/RC_Channel.cpp, RC_Channel/RC_Channels.cpp, GCS_Common.cpp (handle_rc_channels_override).
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from ap_core.clock import Clock
from ap_core.param import FromParams, ParamTable
from mav_handlers.handlers.radio import IGNORED_PWM, RELEASED_PWM
from viso.parameters.copter import NUMBER_OF_CHANNELS

RADIO_AT_REST_US: Final = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800, *(0,) * 8)
"""The pulse lengths in us of the simulator's radio before it is moved."""
_LONGEST_OVERRIDE_S: Final = 120.0
_STICKS: Final = ("ROLL", "PITCH", "THROTTLE", "YAW")


class Sticks(NamedTuple):
    """Deflections -1..1: roll to the right, pitch with the nose up, throttle up of its middle, yaw to the right.

    ``lever`` is the throttle stick from its lower end to its upper, 0..1, without a dead zone about its middle, 0.5.
    """

    roll: float = 0.0
    pitch: float = 0.0
    throttle: float = 0.0
    yaw: float = 0.0
    lever: float = 0.5


CENTRED: Final = Sticks()


class _Range(NamedTuple):
    """The range of a stick, in us: the parameters of its RCn_ group."""

    channel: int
    low: int
    trim: int
    high: int
    dead_zone: int
    is_reversed: bool

    def deflection(self, pwm_us: int) -> float:
        """Return -1..1, about TRIM (RC_Channel::pwm_to_angle_dz_trim)."""
        pwm_us = min(max(pwm_us, self.low), self.high)
        above, below = self.trim + self.dead_zone, self.trim - self.dead_zone
        sign = -1.0 if self.is_reversed else 1.0
        if pwm_us > above:
            return sign * (pwm_us - above) / (self.high - above)
        if pwm_us < below:
            return sign * (pwm_us - below) / (below - self.low)
        return 0.0

    def share(self, pwm_us: int) -> float:
        """Return 0..1, from the lower end of the range to the upper (RC_Channel::pwm_to_range_dz)."""
        pwm_us = min(max(pwm_us, self.low), self.high)
        if self.is_reversed:
            pwm_us = self.high - (pwm_us - self.low)
        bottom = self.low + self.dead_zone
        return max(pwm_us - bottom, 0) / (self.high - bottom) if self.high > bottom else 0.0

    def lever(self, pwm_us: int) -> float:
        """Return 0..1, with 0.5 at the middle of the range (Mode::get_pilot_desired_throttle)."""
        at, middle = self.share(pwm_us), self.share((self.low + self.high) // 2)
        if at < middle:
            return 0.5 * at / middle
        return 0.5 + 0.5 * (at - middle) / (1 - middle) if middle < 1 else 1.0

    def climb(self, pwm_us: int, zone: float) -> float:
        """Return -1..1, about the middle of the range; ``zone`` is THR_DZ as a share of it.

        Source: RC_Channel::get_control_mid, Mode::get_pilot_desired_climb_rate.
        """
        at, middle = self.share(pwm_us), self.share((self.low + self.high) // 2)
        above, below = middle + zone, middle - zone
        if at > above and above < 1:
            return (at - above) / (1 - above)
        if at < below and below > 0:
            return (at - below) / below
        return 0.0


class Receiver:
    """Sixteen channels.

    Attributes:
        radio_us: pulse lengths in us by channel as the radio sends them; None if there is no radio. Then sticks that
            nobody overrides are centred.
    """

    def __init__(self, params: ParamTable, clock: Clock) -> None:
        self.radio_us: Sequence[int] | None = None
        self._clock = clock
        self._overrides: dict[int, tuple[int, int]] = {}
        self._ranges = FromParams(params, lambda: [_range_of(params, name) for name in _STICKS])
        self._override_us = FromParams(params, lambda: _override_us(params))
        self._throttle_zone = FromParams(params, lambda: 1e-3 * params.get_int("THR_DZ"))

    def override(self, pwm_us: Sequence[int]) -> None:
        """Override channels from 1 on: 65535 leaves one as it is, 0 gives it back to the radio."""
        for channel, value in enumerate(pwm_us, start=1):
            if value == RELEASED_PWM:
                self._overrides.pop(channel, None)
            elif value != IGNORED_PWM:
                self._overrides[channel] = value, self._clock.micros64()

    @property
    def is_heard(self) -> bool:
        """Whether the radio, or a ground station in its place, sends any channel."""
        return self.radio_us is not None or bool(self._overrides)

    def pwm_us(self, channel: int) -> int | None:
        """Return the pulse length of a channel from 1 on; None if nobody sends it."""
        value, since_us = self._overrides.get(channel, (RELEASED_PWM, 0))
        if value and self._clock.micros64() - since_us < self._override_us():
            return value
        return None if self.radio_us is None else self.radio_us[channel - 1]

    def channels_us(self) -> tuple[int, ...]:
        """Return all channels as RC_CHANNELS reports them."""
        numbers = range(1, NUMBER_OF_CHANNELS + 1)
        return tuple(
            rest if pwm is None else pwm for rest, pwm in zip(RADIO_AT_REST_US, map(self.pwm_us, numbers), strict=True)
        )

    def sticks(self) -> Sticks:
        """Return where the sticks are."""
        if not self.is_heard:
            return CENTRED
        roll, pitch, throttle, yaw = self._ranges()
        pwm_us = self.pwm_us(throttle.channel)
        leans = self._deflection(roll), self._deflection(pitch)
        if pwm_us is None:
            return Sticks(*leans, yaw=self._deflection(yaw))
        climb = throttle.climb(pwm_us, self._throttle_zone())
        return Sticks(*leans, climb, self._deflection(yaw), throttle.lever(pwm_us))

    def is_throttle_down(self) -> bool:
        """Return whether the throttle stick is at its lower end, or nobody moves it."""
        throttle = self._ranges()[_STICKS.index("THROTTLE")]
        pwm_us = self.pwm_us(throttle.channel)
        return pwm_us is None or throttle.share(pwm_us) == 0

    def _deflection(self, stick: _Range) -> float:
        pwm_us = self.pwm_us(stick.channel)
        return 0.0 if pwm_us is None else stick.deflection(pwm_us)


def _range_of(params: ParamTable, name: str) -> _Range:
    channel = params.get_int(f"RCMAP_{name}")
    row = params.group(f"RC{channel}_").get_int
    return _Range(channel, row("MIN"), row("TRIM"), row("MAX"), row("DZ"), row("REVERSED") != 0)


def _override_us(params: ParamTable) -> float:
    """Return for how long an override lasts, in us (RC_Channels::get_override_timeout_ms)."""
    seconds = float(params.get_float("RC_OVERRIDE_TIME"))
    return math.inf if seconds < 0 else 1e6 * min(seconds, _LONGEST_OVERRIDE_S)
