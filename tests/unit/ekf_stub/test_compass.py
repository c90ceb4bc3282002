# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The compass: when it sets yaw and magnetic field, which one is read, and what its three axes correct."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_core.declination import get_declination_rad, get_earth_field_ga
from ekf_stub.core.vectors import euler_of
from ekf_stub.release import APRIL_2026, JULY_2025, FilterRelease
from tests.unit.ekf_stub.filter_rig import FIELD_NED, HOME, SLOW_LOOP_US, FilterRig, navigating, standing

EARTH, BODY = 16, 19
GAUSS = 0.001


def turned(degrees: float) -> tuple[float, float, float]:
    """Return a field that makes a compass on a vehicle facing north say that it faces elsewhere."""
    angle = math.radians(degrees)
    return FIELD_NED[0] * math.cos(angle), -FIELD_NED[0] * math.sin(angle), FIELD_NED[2]


def with_compass(**options: object) -> FilterRig:
    """Return a vehicle at rest whose yaw its compass has aligned."""
    rig = standing("66661", run_s=3.0, has_compass=True, loop_us=SLOW_LOOP_US, **options)
    assert "MAG0 initial yaw alignment complete" in rig.told()
    return rig


# Alignment


@settings(max_examples=10)
@given(
    roll=st.floats(-0.5, 0.5), pitch=st.floats(-0.5, 0.5), yaw=st.floats(-3.1, 3.1), declination=st.floats(-0.5, 0.5)
)
def test_compass_aligns_yaw_from_true_north_at_any_tilt(
    roll: float, pitch: float, yaw: float, declination: float
) -> None:
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.roll, rig.pitch, rig.yaw = roll, pitch, yaw
    level = FIELD_NED[0]
    rig.field_ned = level * math.cos(declination), level * math.sin(declination), FIELD_NED[2]
    rig.core.inputs.set_declination(declination)
    rig.run_until(lambda: rig.core.yaw.aligned, 4.0)
    found = euler_of(rig.core.state.quat)
    assert found[:2] == pytest.approx((roll, pitch), abs=5e-3)  # as well as the accelerometers have told by then
    assert math.remainder(found[2] - yaw, 2 * math.pi) == pytest.approx(0, abs=0.02)
    assert "MAG0 initial yaw alignment complete" in rig.texts


def test_table_of_the_world_tells_declination_once_there_is_an_origin() -> None:
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.compasses_said = {"finds_declination": True}
    rig.core.inputs.set_declination(0.3)
    rig.run_until(lambda: rig.core.initialised, 2.0)
    rig.lanes.set_origin(HOME)
    rig.run(3.0)
    there = float(get_declination_rad(HOME))
    assert rig.heading == pytest.approx(there, abs=1e-3)
    assert rig.core.yaw.field.declination() == there


def test_compass_waits_for_tilt() -> None:
    rig = standing("66661", run_s=1.2, has_compass=True)
    rig.run(0.6)
    assert not rig.core.tilt_aligned
    assert not rig.core.yaw.aligned


def test_fast_turn_is_waited_for() -> None:
    # GIVEN a vehicle that turns by more than 10 degrees between two readings
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.run(2.2)
    rig.yaw_rate = 3.0
    rig.run(1.5)
    assert rig.core.tilt_aligned
    assert not rig.core.yaw.aligned
    rig.yaw_rate = 0.0
    rig.run(0.5)
    assert rig.core.yaw.aligned


def test_change_to_the_compass_aligns_anew() -> None:
    rig = navigating("66666", has_compass=True)
    rig.field_ned = turned(86.0)
    rig.set_param("SRC1_YAW", 1)
    rig.run(0.4)
    assert rig.heading == pytest.approx(math.radians(86.0), abs=0.01)
    assert rig.told() == []
    assert rig.core.yaw_resets == 2


def test_yaw_is_aligned_a_last_time_2_5_m_above_the_ground() -> None:
    # GIVEN a vehicle that takes off beside iron
    rig = with_compass()
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    rig.forget()
    rig.arm()
    rig.climb(2.4)
    rig.field_ned = turned(10.0)
    assert "MAG0 in-flight yaw alignment complete" not in rig.texts
    rig.climb(0.5)
    assert rig.texts == ["MAG0 in-flight yaw alignment complete"]
    assert rig.heading == pytest.approx(math.radians(10), abs=0.02)
    # AND once a flight
    rig.climb(2.0)
    assert rig.texts == ["MAG0 in-flight yaw alignment complete"]


@pytest.mark.parametrize(
    ("climb_m", "off_deg", "is_anomaly"), [(0.8, 25.0, True), (0.3, 25.0, False), (0.8, 5.0, False)]
)
def test_yaw_that_goes_wrong_as_the_vehicle_leaves_iron_behind_is_aligned_anew(
    climb_m: float, off_deg: float, is_anomaly: bool
) -> None:
    # GIVEN a vehicle that stood beside iron; WHEN it climbs, and the compass says something else
    rig = with_compass(MAG_CAL=2)
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    rig.forget()
    rig.arm()
    rig.climb(climb_m)
    rig.field_ned = turned(off_deg)
    rig.run(1.0)
    # THEN yaw is aligned anew
    assert ("MAG0 ground mag anomaly, yaw re-aligned" in rig.texts) is is_anomaly


def test_anomalies_are_corrected_twice_a_flight() -> None:
    rig = with_compass(MAG_CAL=2)
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    rig.forget()
    rig.arm()
    for off_deg in (25.0, 80.0, 170.0, -60.0):  # each must be worse than the one before
        rig.climb(0.6)
        rig.field_ned = turned(off_deg)
        rig.run(0.5)
    assert rig.texts.count("MAG0 ground mag anomaly, yaw re-aligned") == 2


# Heading


def test_heading_of_the_compass_is_fused_with_the_noise_of_the_parameter() -> None:
    rig = with_compass(YAW_M_NSE=0.25)
    rig.field_ned = turned(math.degrees(0.1))
    before = rig.core.state.look_along_yaw(True)
    rig.run_until(lambda: abs(rig.report.yaw_innovation) > 0.05)
    assert rig.report.yaw_innovation == pytest.approx(-0.1, abs=1e-3)
    assert rig.report.yaw_ratio == pytest.approx(0.01 / (9 * (before + 0.0625)), rel=0.05)  # grown a little since
    assert rig.heading == pytest.approx(0.1 * before / (before + 0.0625), rel=0.1)
    assert rig.core.yaw.mag_fusion == 1


def test_heading_beyond_the_gate_is_rejected_in_flight() -> None:
    rig = with_compass(MAG_CAL=2)
    rig.arm()
    rig.flying_ms = 6000
    rig.field_ned = turned(170.0)
    rig.run(1.0)
    assert rig.report.yaw_ratio > 1
    assert abs(rig.heading) < 0.01


@pytest.mark.parametrize("magcal", [2, 3])  # heading, three axes
def test_compass_that_fails_its_gate_for_10_s_is_lost_until_it_passes_again(magcal: float) -> None:
    rig = with_compass(MAG_CAL=magcal)
    rig.arm()
    rig.flying_ms = 6000
    rig.run(0.3)
    rig.field_ned = turned(170.0)
    rig.run(0.3)
    since_ms = rig.now_ms
    rig.skip(9.2)
    rig.run(0.3)
    assert not rig.core.timeouts(rig.now_ms) & 8
    rig.run(0.6)
    assert rig.now_ms - since_ms > 10_000
    assert rig.core.timeouts(rig.now_ms) & 8
    rig.field_ned = FIELD_NED
    rig.run(0.4)
    assert not rig.core.timeouts(rig.now_ms) & 8


def test_compass_that_comes_is_used_from_that_pass_on() -> None:
    for passes in range(5):
        rig = standing("66661", has_compass=False)
        for _ in range(passes):
            rig.one_pass()
        assert not rig.core.yaw.uses_compass
        rig.core.inputs.has_compass = True
        rig.one_pass()
        assert rig.core.yaw.uses_compass


# Several compasses


def several(count: int = 3, *, in_flight: bool = True, run_s: float = 3.0) -> FilterRig:
    """Return a vehicle with some compasses that has been running for a while."""
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US)
    rig.compass_count = count
    rig.run(3.0)
    if in_flight:
        rig.arm()
        rig.flying_ms = 6000
        rig.run(0.1)
    rig.run(run_s - 3.0)
    rig.forget()
    return rig


def fail_gate(rig: FilterRig) -> None:
    """Let the compass fail its gate for more than 10 s."""
    rig.field_ned = turned(170.0)
    rig.run(0.4)
    rig.skip(10.0)
    rig.run(0.4)


@pytest.mark.parametrize(("count", "said"), [
    # The numbers are counted on from the compass that was just chosen: of three the first comes back.
    (3, ["switching to compass 1", "switching to compass 0"]),
    (2, ["switching to compass 1"]),
    (1, []),
])  # fmt: skip
def test_compass_that_fails_its_gate_in_flight_gives_way_to_each_of_the_others(count: int, said: list[str]) -> None:
    rig = several(count)
    rig.skip(31.0)
    fail_gate(rig)
    assert [text for text in rig.texts if "switching" in text] == said


@pytest.mark.parametrize(
    ("wait_s", "in_flight", "said"), [(0.0, True, {}), (31.0, False, {}), (31.0, True, {"own": 0})]
)
def test_compass_that_fails_its_gate_is_kept_before_30_s_on_the_ground_and_with_affinity(
    wait_s: float, in_flight: bool, said: dict[str, int]
) -> None:
    rig = several(in_flight=in_flight)
    rig.compasses_said = said
    rig.skip(wait_s)
    fail_gate(rig)
    assert [text for text in rig.texts if "switching" in text] == []


def test_compass_that_breaks_gives_way_after_10_s_even_on_the_ground() -> None:
    rig = several(in_flight=False)
    rig.compasses = {0: {"is_healthy": False}, 1: {"is_used": False}}
    rig.run(0.1)
    rig.skip(9.6)
    rig.run(0.1)
    assert rig.texts == []
    rig.skip(0.5)
    rig.run(0.1)
    assert rig.texts == ["switching to compass 2"]


def test_vehicle_that_is_disarmed_goes_back_to_the_first_compass() -> None:
    rig = several(2)
    rig.skip(31.0)
    fail_gate(rig)
    assert rig.core.yaw.compass.number == 1
    rig.forget()
    rig.run(0.2)
    assert rig.texts == []
    rig.arm(False)
    rig.run(0.2)
    assert rig.texts == ["switching to compass 0"]


def test_compass_of_the_core_is_used_while_it_works() -> None:
    rig = several(in_flight=False)
    rig.compasses_said = {"own": 2}
    rig.run(0.2)
    assert (rig.core.yaw.compass.number, rig.texts) == (2, [])
    # AND is kept as it fails, as others are not asked for so soon
    rig.compasses = {2: {"is_healthy": False}}
    rig.run(0.2)
    assert rig.core.yaw.compass.number == 2


def test_compass_that_may_not_be_used_for_yaw_is_none() -> None:
    rig = several(1, in_flight=False)
    assert rig.core.yaw.uses_compass
    rig.compasses = {0: {"is_used": False}}
    rig.run(0.2)
    assert not rig.core.yaw.uses_compass


def test_without_any_compass_none_is_used_from_then_on() -> None:
    rig = several(in_flight=False)
    rig.compasses_said = {"are_available": False}
    rig.run(0.2)
    rig.compasses_said = {}
    rig.run(0.2)
    assert not rig.core.yaw.uses_compass


@pytest.mark.parametrize(("are_consistent", "resets"), [(True, 1), (False, 0)])
def test_compass_that_is_off_for_5_s_before_arming_aligns_yaw_anew(are_consistent: bool, resets: int) -> None:
    # GIVEN a vehicle whose yaw is drawn elsewhere at once, with a GPS
    rig = with_compass(YAW_I_GATE=100, YAW_M_NSE=0.02)
    rig.feeds.add("gps")
    rig.compasses_said = {"are_consistent": are_consistent}
    rig.run(0.5)
    before = rig.core.yaw_resets
    # WHEN its heading fails the gate for 5 s
    rig.yaw_rate = 0.0
    for number in range(80):
        rig.field_ned = turned(90.0 if number % 2 else -90.0)
        rig.run(0.1)
    # THEN yaw is aligned anew, unless compasses disagree
    assert min(rig.core.yaw_resets - before, 1) == resets


# The magnetic fields


def in_air(**options: object) -> FilterRig:
    """Return a vehicle whose fields are estimated, as EK3_MAG_CAL is 4."""
    rig = with_compass(MAG_CAL=4, **options)
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    assert rig.core.state.learns_field
    return rig


@pytest.mark.parametrize(("magcal", "on_ground", "in_flight"), [
    (0, False, True),
    (2, False, False),
    (3, False, False),
    (4, True, True),
    (5, False, False),
])  # fmt: skip
def test_parameter_says_when_the_field_is_estimated(magcal: int, on_ground: bool, in_flight: bool) -> None:
    rig = with_compass(MAG_CAL=magcal)
    assert rig.core.state.learns_field is on_ground
    rig.arm()
    rig.run(0.1)
    assert rig.core.state.learns_field is on_ground
    rig.flying_ms = 6000
    rig.run(0.1)
    assert rig.core.state.learns_field is in_flight
    rig.arm(False)
    rig.run(0.1)
    assert rig.core.state.learns_field is on_ground


def test_field_is_estimated_after_the_last_alignment_by_default() -> None:
    rig = with_compass()
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    rig.arm()
    rig.climb(2.0)
    assert not rig.core.state.learns_field
    rig.climb(1.0)
    rig.run(0.4)
    assert rig.core.state.learns_field
    assert rig.core.yaw.mag_fusion == 2
    rig.arm(False)
    rig.run(0.1)
    assert not rig.core.state.learns_field


@pytest.mark.parametrize(("accel", "wanted"), [(0.3, False), (0.9, True)])
def test_field_may_be_estimated_while_manoeuvring(accel: float, wanted: bool) -> None:
    rig = with_compass(MAG_CAL=1)
    rig.feeds |= {"camera", "velocity"}
    rig.arm()
    rig.move(accel, 0.0, 0.0, 1.5)
    assert rig.core.state.learns_field is wanted


@pytest.mark.parametrize(("release", "learns"), [(JULY_2025, False), (APRIL_2026, True)])
def test_field_on_the_ground_by_mag_cal_7(release: FilterRelease, learns: bool) -> None:
    assert with_compass(MAG_CAL=7, release=release).core.state.learns_field is learns


def test_fields_begin_as_the_compass_feels_and_as_uncertain() -> None:
    rig = with_compass(MAG_CAL=0)
    rig.arm()
    rig.flying_ms = 6000
    rig.one_pass()
    assert rig.core.state.learns_field
    rig.one_pass()
    variances = rig.report.variances
    assert variances[BODY : BODY + 3] == pytest.approx([0.0025] * 3, rel=0.01)
    assert variances[EARTH] == pytest.approx(0.0025, rel=0.01)
    # The direction of the level field has an error of 20 degrees, its length that of the compass.
    by_angle = (math.radians(20) * GAUSS * FIELD_NED[0]) ** 2
    assert variances[EARTH + 1] == pytest.approx(0.0025 * by_angle / (0.0025 + by_angle), rel=0.02)
    assert rig.report.earth_field == pytest.approx([GAUSS * part for part in FIELD_NED], abs=1e-3)


def test_when_fields_are_estimated_is_as_it_was_when_the_filter_began() -> None:
    rig = in_air()
    rig.set_param("MAG_CAL", 2)
    rig.run(0.3)
    assert rig.core.state.learns_field


def test_field_stays_near_that_of_the_table_in_each_step() -> None:
    rig = in_air()
    rig.core.yaw.field.use_table(HOME)
    north, east, down = rig.core.state.earth_field
    rig.core.state.set_earth_field((north + 0.1, east - 0.2, down))
    rig.core.yaw.field.begin_step(forgets_body_field=False)
    assert rig.core.state.earth_field == pytest.approx((north + 0.05, east - 0.05, down))


def test_three_axes_are_fused_instead_of_the_heading_while_the_field_is_estimated() -> None:
    rig = in_air()
    rig.iron = (10.0, 0.0, 0.0)
    rig.run(0.3)
    assert rig.core.yaw.mag_fusion == 2
    assert rig.report.yaw_ratio == 0
    assert rig.report.mag_ratio > 0
    assert rig.report.mag_innovation[0] < 0  # prediction less measurement


def test_one_axis_beyond_its_gate_rejects_all() -> None:
    rig = in_air()
    field = rig.report.earth_field
    rig.iron = (0.0, 900.0, 0.0)
    rig.run(0.4)
    ratios = rig.core.yaw.field.ratios
    assert [ratio >= 1 for ratio in ratios] == [False, True, False]
    assert rig.report.earth_field == pytest.approx(field, abs=1e-3)  # the declination is fused all the same


def test_iron_is_told_from_the_earth_as_the_vehicle_turns() -> None:
    # GIVEN a vehicle with iron on board whose yaw the camera knows
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US, MAG_CAL=4)
    rig.iron = (20.0, -30.0, 0.0)
    rig.feeds |= {"camera", "velocity"}
    rig.run(3.0)
    rig.yaw_rate = 1.0
    rig.run(20.0)
    # THEN its field is found, and the earth's
    level = GAUSS * 20.0, GAUSS * -30.0
    assert rig.report.body_field[:2] == pytest.approx(level, abs=5e-3)  # of 30 mGauss, and more is found later
    assert abs(rig.report.body_field[2]) < 0.02


def test_earth_field_stays_near_that_of_the_table() -> None:
    # GIVEN a limit of 50 mGauss around it; WHEN the compass feels much more
    rig = in_air(MAG_I_GATE=5000)
    rig.compasses_said = {"finds_declination": True}
    rig.run(0.1)
    rig.lanes.set_origin(HOME)
    table = np.array(get_earth_field_ga(HOME).to_tuple(), float)
    north, east, down = (1500.0 * table).tolist()
    rig.field_ned = north, east, down
    rig.run(8.0)
    apart = np.abs(np.array(rig.report.earth_field) - table)
    assert apart.max() <= 0.05 + 1e-3  # the declination is fused after that
    assert apart[2] > 0.04
    # AND it may be switched off
    rig.set_param("MAG_EF_LIM", 0)
    rig.run(8.0)
    assert abs(rig.report.earth_field[2]) > abs(table[2]) + 0.06


def test_field_of_a_table_is_the_one_that_is_reset_to_and_limited_around() -> None:
    rig = FilterRig("66661", has_compass=True, loop_us=SLOW_LOOP_US, MAG_CAL=4)
    rig.compasses_said = {"finds_declination": True}
    table = get_earth_field_ga(HOME).to_tuple()
    x, y, z = (1000.0 * float(part) for part in table)
    rig.field_ned = x, y, z
    rig.run_until(lambda: rig.core.initialised, 2.0)
    rig.lanes.set_origin(HOME)
    assert rig.report.earth_field == pytest.approx(table, abs=1e-6)
    rig.run(3.0)
    assert rig.report.earth_field == pytest.approx(table, abs=5e-3)


def test_offsets_that_change_make_the_vehicles_field_unknown() -> None:
    rig = in_air()
    rig.run(5.0)
    before = rig.report.variances[BODY]
    assert before < 0.0024
    rig.compasses = {0: {"offsets": (5.0, 0.0, 0.0)}}
    rig.run(0.14)
    assert rig.report.body_field == pytest.approx((0.0, 0.0, 0.0), abs=1e-3)
    assert rig.report.variances[BODY] > before


def test_compass_is_believed_less_as_the_vehicle_turns() -> None:
    still, turning = in_air(), in_air()
    turning.yaw_rate = 3.0
    for rig in (still, turning):
        rig.iron = (0.0, 0.0, 30.0)
        rig.run(0.3)
    assert turning.core.yaw.field.ratios[2] < still.core.yaw.field.ratios[2]


def test_field_that_was_learned_is_kept_until_the_vehicle_has_landed() -> None:
    # GIVEN a flight in which the fields were learned
    rig = with_compass(MAG_CAL=0, MAG_M_NSE=0.01)
    rig.feeds |= {"camera", "velocity"}
    rig.run(1.0)
    rig.arm()
    rig.climb(3.0)
    rig.yaw_rate = 1.0
    rig.run(10.0)
    assert rig.core.yaw.field.is_learned
    learned = rig.report.variances[EARTH : BODY + 3]
    # WHEN they are not estimated for a moment in flight
    rig.compasses = {0: {"is_used": False}}
    rig.run(0.1)
    assert rig.report.variances[EARTH : BODY + 3] == (0.0,) * 6
    rig.compasses = {}
    rig.one_pass()
    # THEN they are as well known as before
    rig.one_pass()
    assert max(rig.report.variances[EARTH : BODY + 3]) <= 0.01**2 * 1.01
    assert max(learned[:3]) < 1e-4
    # AND no more on the ground
    rig.arm(False)
    rig.run(0.1)
    assert not rig.core.yaw.field.is_learned
