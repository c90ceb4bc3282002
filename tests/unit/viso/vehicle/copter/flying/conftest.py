# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A copter that flies in virtual time, with an estimator that knows where it is, or does not."""

import math
from collections.abc import Callable

import pytest

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.vector3 import Vector3f
from ekf_stub.reports import FilterFlag
from mav_handlers.handlers.commands.flight import GuidedTarget
from tests.unit.viso.conftest import CopterRig
from viso.vehicle.copter.copter import Copter
from viso.vehicle.copter.modes import ModeNumber, ModeReason
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.source import ImuOptions

PERIOD_US = 20_000
PLACE = Location(473977420, 85455940, 48800)
KNOWS = FilterFlag(
    FilterFlag.ATTITUDE
    | FilterFlag.HORIZ_VEL
    | FilterFlag.VERT_VEL
    | FilterFlag.HORIZ_POS_REL
    | FilterFlag.HORIZ_POS_ABS
    | FilterFlag.VERT_POS
)


class Flyer:
    """A copter that flies; its estimator says what is so, but for what a test adds to it.

    Attributes:
        off_ned: how far off the estimated position is, m.
        off_yaw_rad: how far off the estimated yaw is.
        is_lost: the estimator has no position.
    """

    def __init__(self, rig: CopterRig) -> None:
        source = FlyingSource(ImuOptions())
        self.airframe = source.airframe
        self.rig = rig
        rig.vehicle.source = source
        rig.copter = rig.vehicle.copter = Copter(rig.vehicle)
        self.copter = rig.copter
        self.off_ned = (0.0, 0.0, 0.0)
        self.off_yaw_rad = 0.0
        self.is_lost = False
        rig.ahrs.ekf_origin = PLACE
        rig.ahrs.navigate(KNOWS)
        rig.ahrs.get_yaw_rad = lambda: f32(self.airframe.state.rpy[2] + self.off_yaw_rad)  # type: ignore[method-assign]
        self._estimate()

    def _estimate(self) -> None:
        state, ahrs = self.airframe.state, self.rig.ahrs
        pos = [at + off for at, off in zip(state.pos, self.off_ned, strict=True)]
        ahrs.pos = None if self.is_lost else Vector3f(*pos)
        ahrs.place = None if self.is_lost else PLACE.offset(Vector3f(*pos))
        ahrs.velocity = Vector3f(*state.vel)

    def run(self, seconds: float, until: Callable[[], bool] = lambda: False) -> bool:
        for _ in range(round(seconds * 1e6 / PERIOD_US)):
            self.rig.clock.set_us(self.rig.clock.micros64() + PERIOD_US)
            self.airframe.go_to(self.rig.clock.micros64())
            self._estimate()
            self.copter.update()
            if until():
                return True
        return False

    def take_off(self, height_m: float = 5.0, mode: ModeNumber = ModeNumber.GUIDED) -> None:
        self.copter.modes.set_mode(mode, ModeReason.GCS_COMMAND)
        self.run(0.1)
        assert self.copter.arm(do_checks=False)
        self.run(2.0)  # the arming delay
        assert self.copter.take_off(100 * height_m, must_navigate=True)
        self.run(8.0)
        assert self.pos == pytest.approx((0.0, 0.0, -height_m), abs=0.15)

    def set_mode(self, mode: ModeNumber) -> None:
        assert self.copter.modes.set_mode(mode, ModeReason.GCS_COMMAND)

    def guide(self, **target: object) -> None:
        assert self.copter.flight is not None
        self.copter.flight.guide(GuidedTarget(**target))  # type: ignore[arg-type]

    @property
    def pos(self) -> tuple[float, float, float]:
        return self.airframe.state.pos

    @property
    def yaw_deg(self) -> float:
        return math.degrees(self.airframe.state.rpy[2])


@pytest.fixture
def flyer(rig: CopterRig) -> Flyer:
    """Return a vehicle on the ground."""
    return Flyer(rig)


@pytest.fixture
def up() -> Flyer:
    """Return a vehicle in GUIDED, 5 m above the ground."""
    flyer = Flyer(CopterRig())
    flyer.take_off()
    return flyer
