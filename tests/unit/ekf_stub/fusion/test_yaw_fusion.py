# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where yaw comes from, when it is set and how it is fused."""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.fmath import f32
from ap_core.location import Location
from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.filter.attitude import euler_of, quat_of_euler
from ekf_stub.filter.inertial import Array, InertialStep, pure_quat
from ekf_stub.filter.states import ATT
from ekf_stub.fusion.height_source import Vehicle
from ekf_stub.fusion.measurements import MagSample
from ekf_stub.inputs.compasses import NO_COMPASS
from ekf_stub.inputs.gps_sample import GpsSample

if TYPE_CHECKING:
    from tests.unit.ekf_stub.filter_parts import FilterParts

MakeParts = Callable[..., "FilterParts"]

PARKED = Vehicle(armed=False, on_ground=True, in_flight=False)
UNTILTED = Vehicle(armed=False, on_ground=True, in_flight=False, tilt_aligned=False)
FLYING = Vehicle(armed=True, on_ground=False, in_flight=True)
NOW_MS = 50_000
STEP = InertialStep(NOW_MS, np.zeros(3), np.zeros(3), 0.0125, 0.0125)
INITIAL_VAR = 0.01  # of yaw, as the filter begins
GATE = 9.0
FIVE_DEG = math.radians(5)
FIELD_NED = np.array([0.238, 0.0, -0.529])


def run(
    parts: "FilterParts",
    now_ms: int = NOW_MS,
    *,
    vehicle: Vehicle = PARKED,
    is_still: bool = False,
    climbed_m: float = 0.0,
) -> None:
    """Make a frame and a step."""
    parts.ingest.horizon_ms = now_ms
    parts.gps.recall(now_ms)
    parts.yaw.control(vehicle)
    parts.yaw.step(now_ms, vehicle, STEP, is_still=is_still, climbed_m=lambda: climbed_m)


def see(parts: "FilterParts", yaw: float, *, err: float = 0.2, now_ms: int = NOW_MS, vehicle: Vehicle = PARKED) -> None:
    """Let the camera see a yaw that comes due in a step of now."""
    parts.ingest.horizon_ms = now_ms
    quat = Quaternion.from_euler(f32(0.3), f32(-0.2), f32(yaw))
    parts.ingest.write_pose(Vector3f(), quat, (f32(0.2), f32(err)), now_ms, 0, 0)
    run(parts, now_ms, vehicle=vehicle)


def aligned(make_parts: MakeParts, sources: str = "66666", **params: float) -> "FilterParts":
    """Return parts whose yaw has been aligned to 0; they have nothing more to tell."""
    parts = make_parts(sources, **params)
    see(parts, 0.0, now_ms=NOW_MS - 1000)
    assert parts.yaw.aligned
    parts.told()
    parts.outcomes.clear()
    return parts


def yaw_variance(parts: "FilterParts") -> float:
    row = parts.state.yaw_row(by_321=True)
    return float(row @ parts.state.cov @ row)


# By the camera


def test_first_yaw_is_aligned_to_and_tilt_stays(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.turn_to(0.1, -0.1, 0.0)
    see(parts, 1.5)
    assert euler_of(parts.state.quat) == pytest.approx((0.1, -0.1, 1.5), abs=1e-6)
    assert parts.told() == ["yaw aligned"]
    assert (parts.yaw.aligned, parts.yaw.resets) == (True, 1)
    assert parts.outcomes == [("yaw", "model_aligned", None)]


@pytest.mark.parametrize(("err", "noise"), [(0.3, 0.3), (0.0, FIVE_DEG)])
def test_aligned_yaw_is_as_uncertain_as_it_was_measured_and_tilt_as_before(
    make_parts: MakeParts, err: float, noise: float
) -> None:
    parts = make_parts()
    parts.state.predicted_tilt_variance = tilt = 2e-4
    see(parts, 1.5, err=err)
    assert yaw_variance(parts) == pytest.approx(noise**2)
    assert parts.state.tilt_variance() == pytest.approx(tilt)


def test_alignment_turns_the_outputs_by_as_much_and_forgets_what_attitude_had_to_do_with(
    make_parts: MakeParts,
) -> None:
    parts = make_parts()
    parts.output.rotate(quat_of_euler(0, 0, 0.25))
    parts.state.cov += 1e-4
    see(parts, 1.5)
    assert euler_of(parts.output.now.quat)[2] == pytest.approx(1.75)
    assert not parts.state.cov[ATT, ATT.stop :].any()


def test_yaw_waits_for_tilt_but_counts_as_in_use(make_parts: MakeParts) -> None:
    parts = make_parts()
    see(parts, 1.5, vehicle=UNTILTED)
    assert not parts.yaw.aligned
    assert parts.outcomes == [("yaw", "model_unused", None)]
    assert parts.yaw.uses_ext_nav(NOW_MS + 4999)


@pytest.mark.parametrize(("err", "noise"), [(0.2, 0.2), (0.0, FIVE_DEG), (0.06, FIVE_DEG), (0.5, 0.5)])
def test_yaw_is_fused_with_its_error_of_5_degrees_at_least(make_parts: MakeParts, err: float, noise: float) -> None:
    parts = aligned(make_parts)
    before = yaw_variance(parts)
    see(parts, 0.1, err=err)
    spread = before + noise**2
    assert parts.yaw.innovation == pytest.approx(-0.1)
    assert parts.yaw.ratio == pytest.approx(0.01 / (GATE * spread), rel=1e-5)
    assert parts.state.yaw(by_321=True) == pytest.approx(0.1 * before / spread, rel=1e-3)
    assert parts.outcomes == [("yaw", "model_fused", pytest.approx(math.sqrt(parts.yaw.ratio)))]
    assert parts.told() == []


def test_innovation_goes_the_short_way_round(make_parts: MakeParts) -> None:
    parts = make_parts()
    see(parts, 3.1, now_ms=NOW_MS - 1000)
    see(parts, -3.1)
    assert parts.yaw.innovation == pytest.approx(6.2 - 2 * math.pi, abs=1e-6)


@pytest.mark.parametrize(("vehicle", "is_fused"), [(PARKED, True), (FLYING, False)])
def test_yaw_beyond_the_gate_is_rejected_in_flight_only(
    make_parts: MakeParts, vehicle: Vehicle, is_fused: bool
) -> None:
    parts = aligned(make_parts)
    before = yaw_variance(parts)
    see(parts, 1.57, vehicle=vehicle)
    assert parts.yaw.innovation == pytest.approx(-1.57)
    assert parts.yaw.ratio > 1
    weight = before / (before + 0.04)
    assert parts.state.yaw(by_321=True) == pytest.approx(0.5 * weight if is_fused else 0, rel=0.01, abs=1e-9)
    assert parts.outcomes[0][1] == ("model_fused" if is_fused else "model_gate_yaw")


@pytest.mark.parametrize(("percent", "sigmas"), [(300, 3.0), (100, 1.0), (1, 1.0)])
@pytest.mark.parametrize("passes", [True, False])
def test_gate_is_as_wide_as_its_parameter_but_not_less_than_a_sigma(
    make_parts: MakeParts, percent: float, sigmas: float, passes: bool
) -> None:
    parts = aligned(make_parts, YAW_I_GATE=percent)
    spread = math.sqrt(yaw_variance(parts) + 0.04)
    see(parts, sigmas * spread * (0.999 if passes else 1.001), vehicle=FLYING)
    assert parts.outcomes[0][1] == ("model_fused" if passes else "model_gate_yaw")


def test_position_reset_says_nothing_of_yaw(make_parts: MakeParts) -> None:
    parts = aligned(make_parts)
    quat = Quaternion.from_euler(f32(0), f32(0), f32(1))
    parts.ingest.horizon_ms = NOW_MS
    parts.ingest.write_pose(Vector3f(), quat, (f32(0.2), f32(0.2)), NOW_MS, 0, 7)
    run(parts)
    assert parts.yaw.resets == 1
    assert parts.outcomes[0][1] == "model_fused"


def test_other_source_aligns_anew_with_its_next_yaw(make_parts: MakeParts) -> None:
    parts = aligned(make_parts)
    parts.params.set("EK3_SRC1_YAW", 2)
    run(parts, NOW_MS - 500)
    parts.params.set("EK3_SRC1_YAW", 6)
    run(parts, NOW_MS - 400)
    see(parts, 1.5)
    assert parts.told() == ["yaw aligned"]
    assert parts.yaw.resets == 2
    assert parts.state.yaw(by_321=True) == pytest.approx(1.5)


@pytest.mark.parametrize("sources", ["66661", "66662"])
def test_yaw_of_the_camera_is_not_used_for_another_source(make_parts: MakeParts, sources: str) -> None:
    parts = make_parts(sources)
    see(parts, 1.5)
    assert not parts.yaw.aligned
    assert parts.state.yaw(by_321=True) == 0


def test_infinite_yaw_is_not_believed(make_parts: MakeParts) -> None:
    parts = make_parts()
    parts.ingest.horizon_ms = NOW_MS
    infinite = Quaternion(f32(0), f32(math.inf), f32(0), f32(0))
    parts.ingest.write_pose(Vector3f(), infinite, (f32(0.2), f32(0.2)), NOW_MS, 0, 0)
    run(parts)
    assert not parts.yaw.aligned
    assert ("yaw", "model_not_finite", None) in parts.outcomes or ("yaw", "yaw_nan", None) in parts.outcomes


# Assumed, while it is missing


def test_missing_yaw_is_assumed_to_stay_now_and_then_until_it_is_aligned(make_parts: MakeParts) -> None:
    parts = make_parts()
    times = []
    for now_ms in range(NOW_MS, NOW_MS + 500, 10):
        before = yaw_variance(parts)
        run(parts, now_ms)
        if yaw_variance(parts) != before:
            times.append(now_ms - NOW_MS)
    assert times == [0, 150, 300, 450]
    assert parts.state.yaw(by_321=True) == 0


def test_assumed_yaw_is_as_uncertain_as_the_parameter_says(make_parts: MakeParts) -> None:
    parts = make_parts(YAW_M_NSE=0.25)
    run(parts)
    assert yaw_variance(parts) == pytest.approx(INITIAL_VAR * 0.0625 / (INITIAL_VAR + 0.0625))
    assert (parts.yaw.innovation, parts.yaw.ratio) == (0, 0)


def test_yaw_is_not_assumed_before_tilt_is_known_or_after_it_was_aligned(make_parts: MakeParts) -> None:
    parts = make_parts()
    run(parts, vehicle=UNTILTED)
    assert yaw_variance(parts) == pytest.approx(INITIAL_VAR)
    parts = aligned(make_parts)
    before = yaw_variance(parts)
    run(parts)
    assert yaw_variance(parts) == before


def test_vehicle_that_stands_still_keeps_the_yaw_that_it_had_when_it_moved_last(make_parts: MakeParts) -> None:
    parts = make_parts(YAW_M_NSE=0.25)
    run(parts, NOW_MS - 200)
    parts.turn_to(yaw=0.1)
    before = yaw_variance(parts)
    run(parts, NOW_MS, is_still=True)
    assert parts.yaw.innovation == pytest.approx(0.1)
    assert parts.state.yaw(by_321=True) == pytest.approx(0.1 * 0.0625 / (before + 0.0625), rel=1e-3)


@pytest.mark.parametrize("sources", ["66660", "66668"])
def test_vehicle_without_a_yaw_to_measure_assumes_it(make_parts: MakeParts, sources: str) -> None:
    parts = make_parts(sources)
    run(parts)
    assert yaw_variance(parts) < INITIAL_VAR
    assert not parts.yaw.aligned


# Whether it is in use


@pytest.mark.parametrize(("after_ms", "in_use"), [(4999, True), (5000, False)])
def test_camera_counts_as_the_source_for_5_s_after_its_last_yaw(
    make_parts: MakeParts, after_ms: int, in_use: bool
) -> None:
    parts = make_parts()
    see(parts, 0.0)
    assert parts.yaw.uses_ext_nav(NOW_MS + after_ms) is in_use


def test_camera_counts_as_the_source_while_yaw_is_assumed_and_just_after_boot(make_parts: MakeParts) -> None:
    parts = make_parts()
    assert parts.yaw.uses_ext_nav(4999)
    assert not parts.yaw.uses_ext_nav(NOW_MS)
    run(parts)
    assert parts.yaw.uses_ext_nav(NOW_MS + 4999)


def test_camera_does_not_count_while_another_source_is_named(make_parts: MakeParts) -> None:
    assert not make_parts("66661").yaw.uses_ext_nav(100)


@pytest.mark.parametrize(("sources", "has_compass", "source", "uses"), [
    ("66661", True, 1, True),
    ("66661", False, 0, False),
    ("66663", True, 3, True),
    ("66663", False, 3, False),
    ("66666", True, 6, False),
])  # fmt: skip
def test_compass_that_is_not_there_is_no_source(
    make_parts: MakeParts, sources: str, has_compass: bool, source: int, uses: bool
) -> None:
    parts = make_parts(sources)
    parts.has_compass = has_compass
    run(parts)
    assert (parts.yaw.source, parts.yaw.uses_compass) == (source, uses)


# By the compass


def felt(rpy: tuple[float, float, float], field: Array = FIELD_NED) -> Array:
    """Return the earth's field as a compass feels it at an attitude."""
    turned: Array = (quat_of_euler(*rpy).conjugate() * pure_quat(field) * quat_of_euler(*rpy)).vec
    return turned


def feel(
    parts: "FilterParts",
    rpy: tuple[float, float, float],
    *,
    now_ms: int = NOW_MS,
    vehicle: Vehicle = PARKED,
    field: Array = FIELD_NED,
) -> None:
    """Let the compass feel the earth's field at an attitude, in a step of now."""
    parts.yaw.compass.samples.push(MagSample(now_ms, felt(rpy, field)))
    run(parts, now_ms, vehicle=vehicle)


@settings(max_examples=30)
@given(
    roll=st.floats(-0.6, 0.6), pitch=st.floats(-0.6, 0.6), yaw=st.floats(-3.1, 3.1), declination=st.floats(-0.5, 0.5)
)
def test_compass_aligns_yaw_from_true_north_at_any_tilt(
    make_parts: MakeParts, roll: float, pitch: float, yaw: float, declination: float
) -> None:
    parts = make_parts("66661")
    parts.turn_to(roll, pitch, 0.3)
    parts.yaw.field.declination = declination
    level = np.array([math.cos(declination), math.sin(declination)]) * FIELD_NED[0]
    for now_ms in (NOW_MS, NOW_MS + 100):  # a vehicle that turns fast is waited for
        feel(parts, (roll, pitch, yaw), field=np.array([*level, FIELD_NED[2]]), now_ms=now_ms)
    assert parts.told() == ["MAG0 initial yaw alignment complete"]
    found = euler_of(parts.state.quat)
    assert found[:2] == pytest.approx((roll, pitch), abs=1e-6)
    assert math.remainder(found[2] - yaw, 2 * math.pi) == pytest.approx(0, abs=1e-6)


def test_compass_waits_for_tilt(make_parts: MakeParts) -> None:
    parts = make_parts("66661")
    feel(parts, (0, 0, 1.5), vehicle=UNTILTED)
    assert not parts.yaw.aligned


def test_heading_of_the_compass_is_fused_with_the_noise_of_the_parameter(make_parts: MakeParts) -> None:
    parts = make_parts("66661", YAW_M_NSE=0.25)
    feel(parts, (0, 0, 0.0), now_ms=NOW_MS - 100)
    before = yaw_variance(parts)
    feel(parts, (0, 0, 0.1))
    assert parts.yaw.innovation == pytest.approx(-0.1)
    assert parts.yaw.ratio == pytest.approx(0.01 / (GATE * (before + 0.0625)), rel=1e-4)
    assert parts.state.yaw(by_321=True) == pytest.approx(0.1 * before / (before + 0.0625), rel=1e-3)


def test_text_names_the_compass_in_use(make_parts: MakeParts) -> None:
    parts = make_parts("66661")
    parts.yaw.compass.number = 2
    feel(parts, (0, 0, 0))
    assert parts.told() == ["MAG2 initial yaw alignment complete"]


@pytest.mark.parametrize("magcal", [2, 3])  # heading, three axes
def test_compass_that_fails_its_gate_for_10_s_is_lost_until_it_passes_again(
    make_parts: MakeParts, magcal: float
) -> None:
    parts = make_parts("66661", MAG_CAL=magcal)
    parts.yaw.compass.begin(NO_COMPASS, NOW_MS)
    lost = []
    for yaw, now_ms in ((0.0, 0), (0.0, 100), (3.0, 200), (3.0, 5000), (3.0, 10_200), (3.0, 10_300), (0.0, 10_400)):
        feel(parts, (0, 0, yaw), now_ms=NOW_MS + now_ms, vehicle=FLYING)
        lost.append(parts.yaw.compass.is_lost)
    run(parts, NOW_MS + 10_500, vehicle=FLYING)
    assert (lost, parts.yaw.compass.is_lost) == ([False] * 5 + [True] * 2, False)


@pytest.mark.parametrize(("magcal", "kind"), [(2, 1), (4, 2)])
def test_three_axes_are_fused_instead_of_the_heading_while_the_field_is_estimated(
    make_parts: MakeParts, magcal: float, kind: int
) -> None:
    parts = make_parts("66661", MAG_CAL=magcal)
    assert parts.yaw.mag_fusion == 0
    for now_ms in (NOW_MS - 200, NOW_MS - 100, NOW_MS):
        feel(parts, (0, 0, 0.01 if now_ms == NOW_MS else 0.0), now_ms=now_ms)
    assert parts.yaw.mag_fusion == kind
    assert parts.yaw.field_was_fused is (kind == 2)
    assert (parts.yaw.ratio > 0) is (kind == 1)
    assert bool((parts.yaw.field.ratios > 0).any()) is (kind == 2)


def test_heading_beyond_the_gate_is_rejected_in_flight(make_parts: MakeParts) -> None:
    parts = make_parts("66661", MAG_CAL=2)
    feel(parts, (0, 0, 0.0), now_ms=NOW_MS - 100)
    feel(parts, (0, 0, 3.0), vehicle=FLYING)
    assert parts.yaw.ratio > 1
    assert parts.state.yaw(by_321=True) == pytest.approx(0, abs=1e-6)


def test_change_to_the_compass_aligns_anew(make_parts: MakeParts) -> None:
    parts = aligned(make_parts)
    parts.params.set("EK3_SRC1_YAW", 1)
    feel(parts, (0, 0, 1.5))
    assert parts.state.yaw(by_321=True) == pytest.approx(1.5)
    assert parts.told() == []
    assert parts.yaw.resets == 2


def test_yaw_is_aligned_a_last_time_high_above_the_ground(make_parts: MakeParts) -> None:
    parts = make_parts("66661")
    feel(parts, (0, 0, 0.0), now_ms=NOW_MS - 200)
    parts.told()
    parts.yaw.compass.samples.push(MagSample(NOW_MS, felt((0, 0, 0.4))))
    run(parts, vehicle=FLYING, climbed_m=2.6)
    assert parts.told() == ["MAG0 in-flight yaw alignment complete"]
    assert parts.state.yaw(by_321=True) == pytest.approx(0.4, abs=1e-3)


# By the GPS


def fix(parts: "FilterParts", yaw_deg: float | None, *, now_ms: int = NOW_MS, vehicle: Vehicle = PARKED) -> None:
    """Let a solution of the GPS come due in a step of now."""
    place = Location(-353632610, 1491652300, 58400)
    values: dict[str, Any] = {"fix_type": 3, "location": place, "vel_ned": Vector3f(), "num_sats": 10}
    parts.gps.push(GpsSample(time_ms=now_ms, yaw_deg=yaw_deg, **values), place, 0.01 * place.alt_cm, now_ms, now_ms)
    run(parts, now_ms, vehicle=vehicle)


def test_gps_aligns_yaw_and_is_fused_with_5_degrees(make_parts: MakeParts) -> None:
    parts = make_parts("66662")
    fix(parts, 270.0, now_ms=NOW_MS - 200)
    assert parts.told() == ["yaw aligned"]
    assert parts.state.yaw(by_321=True) == pytest.approx(-math.pi / 2)
    before = yaw_variance(parts)
    assert before == pytest.approx(FIVE_DEG**2, rel=0.01)
    fix(parts, 276.0)
    assert parts.yaw.innovation == pytest.approx(-math.radians(6), abs=1e-6)
    assert parts.yaw.ratio == pytest.approx(math.radians(6) ** 2 / (GATE * (before + FIVE_DEG**2)), rel=1e-4)


def test_gps_without_a_yaw_leaves_it_assumed(make_parts: MakeParts) -> None:
    parts = make_parts("66662")
    fix(parts, None)
    assert not parts.yaw.aligned
    assert yaw_variance(parts) < INITIAL_VAR


def test_gps_waits_for_tilt(make_parts: MakeParts) -> None:
    parts = make_parts("66662")
    fix(parts, 270.0, vehicle=UNTILTED)
    assert not parts.yaw.aligned


def test_compass_is_not_used_beside_a_gps_that_gives_yaw(make_parts: MakeParts) -> None:
    parts = make_parts("66663")
    fix(parts, 90.0, now_ms=NOW_MS - 200)
    feel(parts, (0, 0, 0.0))
    assert (parts.yaw.innovation, parts.yaw.resets) == (0, 1)
    assert parts.state.yaw(by_321=True) == pytest.approx(math.pi / 2)
    assert parts.told() == ["yaw aligned"]
