# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""When the motors may turn, how long they take, and how the frame is named.

Source: ArduCopter/motors.cpp (motors_output), AP_Motors/AP_MotorsMulticopter.cpp (output_logic).
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from ap_core.clock import NEVER
from ap_core.param import ParamTable

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle

EV_INTERLOCK_DISABLED: Final = 56
EV_INTERLOCK_ENABLED: Final = 57
ARMING_DELAY_MS: Final = 2000
SPIN_UP_US: Final = 333_000
"""From rest to the idle speed of an armed vehicle: MOT_SPIN_ARM / MOT_SPIN_MIN of MOT_SPOOL_TIME."""
LIFT_US: Final = 1_277_000
"""From rest until the motors of the reference lifted it, in all recordings."""
SPOOL_DOWN_US: Final = 507_000
"""From the end of a landing until the motors of the reference idled, in all recordings."""
_QUAD_TYPES: Final[Mapping[int, str]] = MappingProxyType(
    {
        0: "PLUS",
        1: "X",
        2: "V",
        3: "H",
        4: "VTAIL",
        5: "ATAIL",
        6: "PLUSREV",
        12: "BF_X",
        13: "DJI_X",
        14: "CW_X",
        16: "NYT_PLUS",
        17: "NYT_X",
        18: "X_REV",
        19: "Y4",
    }
)
"""Names of FRAME_TYPE in texts, of a quad (AP_MotorsMatrix::setup_quad_matrix)."""


def frame_text(params: ParamTable) -> str:
    """Return the text that names the frame (AP_Motors::get_frame_and_type_string).

    FIRMWARE PARITY: whatever FRAME_CLASS says, it is a quad.
    """
    kind = _QUAD_TYPES.get(params.get_int("FRAME_TYPE"))
    return "Frame: QUAD" if kind is None else f"Frame: QUAD/{kind}"


class Motors:
    """Motors that turn from 2 s after arming on."""

    def __init__(self, vehicle: "Vehicle") -> None:
        self._log = vehicle.log
        self._clock = vehicle.clock
        self._turn_us = self._idle_us = NEVER
        self._interlock = False

    def arm(self) -> None:
        """Turn after the arming delay."""
        self._turn_us = (self._clock.micros64() // 1000 + ARMING_DELAY_MS + 1) * 1000
        self._idle_us = self._turn_us

    def disarm(self) -> None:
        """Stop."""
        self._turn_us = self._idle_us = NEVER

    def land(self) -> None:
        """Spool down to idle."""
        self._idle_us = self._clock.micros64() + SPOOL_DOWN_US

    def update(self) -> None:
        """Return whether they may turn if that has changed; every main loop."""
        interlock = self._clock.micros64() >= self._turn_us
        if interlock != self._interlock:
            self._interlock = interlock
            self._log.event(EV_INTERLOCK_ENABLED if interlock else EV_INTERLOCK_DISABLED)

    def idle_until_us(self) -> int:
        """Return until when ``update`` has nothing to do, us since boot; 0 if it may have at once."""
        if not self._interlock:
            return self._turn_us
        return 0 if self._turn_us == NEVER else NEVER

    def lift_us(self) -> int:
        """Return when they lift a vehicle that takes off now."""
        now_us = self._clock.micros64()
        spun_us = min(max(now_us - self._idle_us, 0), SPIN_UP_US)
        return max(now_us, self._turn_us) + LIFT_US - spun_us

    def idle_us(self) -> int:
        """Return from when on they idle, of a vehicle that stands on the ground."""
        return self._idle_us
