# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which flags of the estimator make height and position good enough."""

from typing import TYPE_CHECKING

import pytest

from ap_core.vector3 import Vector3f
from ekf_stub.reports import FilterFlag, FilterStatus
from viso.vehicle.copter.estimates import Estimates

if TYPE_CHECKING:
    from tests.unit.viso.conftest import CopterRig

F = FilterFlag


def estimates(rig: "CopterRig", *, armed: bool = False, aided: bool = True, failed: bool = False) -> Estimates:
    # The AHRS is no more than is asked for.
    return Estimates(rig.ahrs, lambda: armed, lambda: aided, lambda: failed)  # type: ignore[arg-type]


@pytest.mark.parametrize(("flags", "ok"), [
    (F.VERT_POS | F.VERT_VEL, True), (F.VERT_POS, False), (F.VERT_VEL, False), (F.UNINITIALISED, False),
])  # fmt: skip
def test_height_needs_position_and_velocity(rig: "CopterRig", flags: FilterFlag, ok: bool) -> None:
    rig.ahrs.navigate(flags)
    assert estimates(rig).alt_ok() is ok


@pytest.mark.parametrize(("flags", "armed", "aided", "ok"), [
    (F.HORIZ_POS_ABS, False, False, True),
    (F.PRED_HORIZ_POS_ABS, False, False, True),
    (F.PRED_HORIZ_POS_REL, False, True, True),
    (F.PRED_HORIZ_POS_REL, False, False, False),
    (F.HORIZ_POS_REL, False, True, False),
    (F.HORIZ_POS_ABS, True, False, True),
    (F.HORIZ_POS_ABS | F.CONST_POS_MODE, True, True, False),
    (F.PRED_HORIZ_POS_ABS, True, True, False),
    (F.HORIZ_POS_REL, True, True, True),
    (F.HORIZ_POS_REL, True, False, False),
    (F.HORIZ_POS_REL | F.CONST_POS_MODE, True, True, False),
    (F.PRED_HORIZ_POS_REL, True, True, False),
])  # fmt: skip
def test_prediction_of_the_position_is_enough_while_disarmed(
    rig: "CopterRig", flags: FilterFlag, armed: bool, aided: bool, ok: bool
) -> None:
    rig.ahrs.navigate(flags)
    assert estimates(rig, armed=armed, aided=aided).position_ok() is ok


def test_no_position_is_good_enough_in_a_failsafe(rig: "CopterRig") -> None:
    seen = estimates(rig, failed=True)
    assert (seen.has_position(), seen.position_ok()) == (True, False)


def test_stand_in_for_the_estimator_is_believed_while_it_has_a_position(rig: "CopterRig") -> None:
    rig.ahrs.status = None
    seen = estimates(rig)
    assert (seen.attitude_ok(), seen.alt_ok(), seen.position_ok()) == (True, False, False)
    rig.ahrs.pos = Vector3f()
    assert (seen.attitude_ok(), seen.alt_ok(), seen.position_ok()) == (True, True, True)


def test_attitude_of_a_stand_in_is_good_once_it_has_started(rig: "CopterRig") -> None:
    rig.ahrs.status = None
    rig.ahrs.started = False
    assert not estimates(rig).attitude_ok()


@pytest.mark.parametrize(("flags", "ok"), [(F.ATTITUDE, True), (F.UNINITIALISED, False)])
def test_attitude_is_good_when_the_estimator_says_so(rig: "CopterRig", flags: FilterFlag, ok: bool) -> None:
    rig.ahrs.navigate(flags)
    assert estimates(rig).attitude_ok() is ok


def test_gps_is_glitching_when_the_estimator_says_so(rig: "CopterRig") -> None:
    assert not estimates(rig).is_gps_glitching()
    rig.ahrs.navigate(F.GPS_GLITCHING)
    assert estimates(rig).is_gps_glitching()
    rig.ahrs.status = None
    assert not estimates(rig).is_gps_glitching()


@pytest.mark.parametrize(("variances", "failing"), [
    ((0.79, 0.79, 0.79, 0.79), None),
    ((0.0, 0.0, 0.0, 0.8), "compass"),
    ((0.0, 0.8, 0.0, 0.0), "position"),
    ((0.8, 0.0, 0.0, 0.0), "velocity"),
    ((0.0, 0.0, 0.8, 0.0), "height"),
    ((1.0, 1.0, 1.0, 1.0), "compass"),
    ((1.0, 1.0, 1.0, 0.0), "position"),
    ((float("nan"), 0.0, 0.0, 0.0), "velocity"),
])  # fmt: skip
def test_first_variance_that_is_not_below_the_threshold_fails(
    rig: "CopterRig", variances: tuple[float, ...], failing: str | None
) -> None:
    rig.ahrs.status = FilterStatus(F.ATTITUDE, *variances)
    assert estimates(rig).failing_variance(0.8) == failing


def test_threshold_0_and_a_stand_in_have_no_failing_variance(rig: "CopterRig") -> None:
    rig.ahrs.status = FilterStatus(F.ATTITUDE, 2.0)
    assert estimates(rig).failing_variance(0.0) is None
    rig.ahrs.status = None
    assert estimates(rig).failing_variance(0.8) is None
