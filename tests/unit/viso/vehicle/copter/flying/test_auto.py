# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle does in AUTO, from take-off to the end of its mission."""

import math
from types import SimpleNamespace

import pytest

from ap_core.vector3 import Vector3f
from mav_handlers.transfers.mission_items import FRAME_RELATIVE, Cmd, MissionItem
from tests.unit.viso.conftest import CopterRig
from tests.unit.viso.vehicle.copter.flying.conftest import PLACE, Flyer
from viso.vehicle.copter.arming import ArmMethod
from viso.vehicle.copter.mission import MissionState
from viso.vehicle.copter.modes import ModeNumber

HOME_ITEM = MissionItem(Cmd.NAV_WAYPOINT)
WITHOUT_THROTTLE = 3.0
THROTTLE = 3


def place(command: int, north_m: float, east_m: float, up_m: float, *params: float) -> MissionItem:
    """Return an item at a place, from where the vehicle stood and above home; up of 0 leaves the height open."""
    at = PLACE.offset(Vector3f(north_m, east_m, 0))
    return MissionItem(command, FRAME_RELATIVE, padded(*params), at.lat, at.lng, up_m)


def padded(*params: float) -> tuple[float, float, float, float]:
    first, second, third, fourth = (*params, *(0.0,) * 4)[:4]
    return first, second, third, fourth


def do(command: int, *params: float) -> MissionItem:
    return MissionItem(command, params=padded(*params))


TAKEOFF = MissionItem(Cmd.NAV_TAKEOFF, FRAME_RELATIVE, z=6.0)
LAND = MissionItem(Cmd.NAV_LAND, FRAME_RELATIVE)
STAY = MissionItem(Cmd.NAV_LOITER_UNLIM, FRAME_RELATIVE)


class MissionFlyer(Flyer):
    """A copter with a home where it stands, whose texts are those of its mission."""

    def __init__(self, *items: MissionItem) -> None:
        super().__init__(CopterRig())
        self.copter.has_booted = True
        self.rig.params.set("AUTO_OPTIONS", WITHOUT_THROTTLE)
        assert self.copter.home.set(PLACE, lock=True)
        self.mission = self.copter.mission
        self.mission.load([HOME_ITEM, *items])

    def begin(self) -> None:
        self.run(0.1)
        assert self.copter.arm(do_checks=False)
        self.set_mode(ModeNumber.AUTO)

    def run_to(self, seq: int, seconds: float = 60.0) -> None:
        assert self.run(seconds, lambda: self.mission.nav_seq == seq)

    def texts(self) -> list[str]:
        return [text for text in self.rig.take_texts() if not text.startswith(("Arming", "Disarming", "Field"))]


def flown(*items: MissionItem) -> MissionFlyer:
    """Return a copter that has taken off and begun the command after that."""
    flyer = MissionFlyer(TAKEOFF, *items)
    flyer.begin()
    flyer.run_to(2)
    flyer.rig.take_texts()
    return flyer


def test_mission_is_flown_to_its_end() -> None:
    flyer = MissionFlyer(TAKEOFF, place(16, 12, 0, 6), place(16, 12, 8, 9), LAND)
    flyer.begin()
    reached: list[int] = []

    def is_over() -> bool:
        if "MISSION_ITEM_REACHED" in flyer.copter.take_changed():
            reached.append(flyer.mission.reached_seq)
        return not flyer.copter.is_armed()

    assert flyer.run(120.0, is_over)
    assert reached == [1, 2, 3]
    assert flyer.pos == pytest.approx((12.0, 8.0, 0.0), abs=0.3)
    assert flyer.texts() == [
        "Mission: 1 Takeoff",
        "Mission: 2 WP",
        "Reached command #2",
        "Mission: 3 WP",
        "Reached command #3",
        "Mission: 4 Land",
        "Mission: 1 Takeoff",
    ]
    assert flyer.copter.is_landed()


def test_vehicle_disarms_after_the_landing_of_a_mission_and_the_mission_begins_anew() -> None:
    flyer = flown(LAND)
    assert flyer.run(60.0, lambda: not flyer.copter.is_armed())
    assert flyer.copter.custom_mode() == ModeNumber.AUTO
    assert [values[3] for _, values in flyer.rig.written("ARM")] == [ArmMethod.MAVLINK, ArmMethod.LANDED]
    flyer.run(0.1)
    assert flyer.mission.nav_seq == 1


def test_mission_that_ends_in_the_air_stays_there() -> None:
    flyer = flown(place(16, 5, 0, 6))
    assert flyer.run(30.0, lambda: flyer.mission.state is MissionState.COMPLETE)
    flyer.run(5.0)
    assert flyer.copter.is_armed()
    assert flyer.pos == pytest.approx((5.0, 0.0, -6.0), abs=0.6)
    assert max(map(abs, flyer.airframe.state.vel)) < 0.05


def test_mission_that_ends_on_the_ground_disarms() -> None:
    flyer = flown(do(Cmd.NAV_RETURN_TO_LAUNCH))
    flyer.rig.params.set("RTL_LOIT_TIME", 0)
    assert flyer.run(90.0, lambda: not flyer.copter.is_armed())
    assert flyer.mission.reached_seq == 2
    assert [values[3] for _, values in flyer.rig.written("ARM")] == [ArmMethod.MAVLINK, ArmMethod.MISSIONEXIT]


def test_lift_off_waits_for_the_throttle() -> None:
    flyer = MissionFlyer(TAKEOFF, STAY)
    flyer.rig.params.set("AUTO_OPTIONS", 0)
    flyer.copter.receiver.override([1500, 1500, 1000])
    flyer.begin()
    flyer.run(2.5)
    assert flyer.copter.is_landed()
    flyer.copter.receiver.override([1500, 1500, 1500])
    flyer.run(5.0)
    assert not flyer.copter.is_landed()
    assert flyer.copter.is_taking_off()


@pytest.mark.parametrize("items", [(), (place(16, 5, 0, 6), LAND)])
def test_auto_is_refused_on_the_ground_without_a_takeoff(items: tuple[MissionItem, ...]) -> None:
    flyer = MissionFlyer(*items)
    flyer.run(0.1)
    assert flyer.copter.arm(do_checks=False)
    flyer.rig.take_texts()
    assert not flyer.copter.set_mode(ModeNumber.AUTO)
    refusal = "Mode change to AUTO failed: init failed"
    assert flyer.texts() == (["Auto: Missing Takeoff Cmd", refusal] if items else [refusal])


def test_disarmed_vehicle_enters_auto_and_begins_with_its_takeoff() -> None:
    flyer = MissionFlyer(TAKEOFF, STAY)
    flyer.run(0.1)
    flyer.set_mode(ModeNumber.AUTO)
    flyer.run(1.0)
    assert flyer.texts() == ["Mission: 1 Takeoff"]
    assert flyer.copter.arm(do_checks=False)
    flyer.run_to(2)
    assert flyer.pos[2] == pytest.approx(-6.0, abs=0.3)


def test_mission_waits_for_an_origin() -> None:
    flyer = MissionFlyer(TAKEOFF, STAY)
    flyer.rig.ahrs.ekf_origin = None
    flyer.set_mode(ModeNumber.AUTO)
    flyer.run(1.0)
    assert flyer.texts() == []
    flyer.rig.ahrs.ekf_origin = PLACE
    flyer.run(0.1)
    assert flyer.texts() == ["Mission: 1 Takeoff"]


@pytest.mark.parametrize(("options", "failure"), [(0, "AUTO mode not armable"), (1, None)])
def test_auto_is_armed_in_if_its_options_say_so(options: int, failure: str | None) -> None:
    flyer = MissionFlyer(TAKEOFF, STAY)
    flyer.rig.params.set("AUTO_OPTIONS", options)
    flyer.set_mode(ModeNumber.AUTO)
    flyer.run(0.1)
    flyer.rig.take_texts()
    assert flyer.copter.arm(do_checks=True) == (failure is None)
    assert (f"Arm: {failure}" in flyer.texts()) == (failure is not None)


def test_leg_is_straight_in_three_dimensions() -> None:
    flyer = flown(place(16, 40, 0, 16), STAY)
    off = []

    def watch() -> bool:
        north, _, down = flyer.pos
        off.append(abs((-down - 6.0) - north / 4.0))
        return flyer.mission.nav_seq == 3

    assert flyer.run(60.0, watch)
    assert max(off) < 2.0


def test_vehicle_passes_a_waypoint_and_stops_where_it_waits() -> None:
    flyer = flown(place(16, 10, 0, 6), place(16, 20, 0, 6, 3.0), place(16, 20, 10, 6), LAND)
    flyer.run_to(3)
    assert flyer.airframe.state.vel[0] > 1.0
    assert flyer.run(30.0, lambda: math.dist(flyer.pos, (20.0, 0.0, -6.0)) < 0.5)
    assert not flyer.run(2.5, lambda: flyer.mission.nav_seq == 4)
    flyer.run_to(4, 4.0)


def test_what_a_waypoint_leaves_open_is_as_it_was() -> None:
    flyer = flown(place(16, 10, 0, 0), MissionItem(Cmd.NAV_WAYPOINT, FRAME_RELATIVE, z=9.0), STAY)
    flyer.run_to(3)
    assert flyer.pos == pytest.approx((8.0, 0.0, -6.0), abs=0.6)
    flyer.run_to(4)
    flyer.run(5.0)
    assert flyer.pos == pytest.approx((10.0, 0.0, -9.0), abs=0.3)


def test_turns_about_a_place() -> None:
    flyer = flown(place(Cmd.NAV_LOITER_TURNS, 0, 0, 6, 1.0, 0.0, -8.0), STAY)
    assert flyer.run(30.0, lambda: "Mission: starting circle 1/1" in flyer.texts())
    distances, turned, last = [], 0.0, math.atan2(flyer.pos[1], flyer.pos[0])

    def watch() -> bool:
        nonlocal turned, last
        now = math.atan2(flyer.pos[1], flyer.pos[0])
        turned += math.remainder(now - last, 2 * math.pi)
        last = now
        distances.append(math.hypot(*flyer.pos[:2]))
        return flyer.mission.nav_seq == 3

    assert flyer.run(60.0, watch)
    assert turned == pytest.approx(-2 * math.pi, abs=0.3)
    assert max(abs(distance - 8.0) for distance in distances) < 1.0


def test_landing_at_a_place_flies_there_first() -> None:
    flyer = flown(place(Cmd.NAV_LAND, 10, 0, 0))
    assert flyer.run(90.0, lambda: not flyer.copter.is_armed())
    assert flyer.pos == pytest.approx((10.0, 0.0, 0.0), abs=0.3)


def test_delays_and_a_condition_of_distance() -> None:
    flyer = flown(do(Cmd.NAV_DELAY, 2.0), do(Cmd.CONDITION_DISTANCE, 10.0), do(178, 1, 3), place(16, 30, 0, 6), STAY)
    assert not flyer.run(1.9, lambda: flyer.mission.nav_seq == 5)
    flyer.run_to(5, 0.2)
    assert flyer.run(30.0, lambda: "Mission: 4 ChangeSpeed" in flyer.texts())
    assert flyer.pos[0] == pytest.approx(20.0, abs=0.5)


def test_delay_until_a_time_of_day() -> None:
    flyer = MissionFlyer(TAKEOFF, do(Cmd.NAV_DELAY, 0.0, -1.0, 1.0, 0.0), STAY)
    noon_us = 86_400_000_000 * 20_000 + 12 * 3_600_000_000
    flyer.rig.vehicle.rtc = SimpleNamespace(utc_us=lambda: noon_us + 58_000_000)  # type: ignore[assignment]
    flyer.begin()
    flyer.run_to(2)
    assert "Delaying 2 sec" in flyer.texts()


@pytest.mark.parametrize(("kind", "speed"), [(0, 2.0), (1, 3.0)])
def test_speed_changes_on_the_way(kind: int, speed: float) -> None:
    flyer = flown(STAY, do(Cmd.DO_CHANGE_SPEED, kind, speed), place(16, 60, 0, 6), STAY)
    assert flyer.mission.set_current(3)
    flyer.run(8.0)
    assert flyer.airframe.state.vel[0] == pytest.approx(speed, rel=0.05)


def test_heading_waits_for_a_condition_and_looks_at_a_place() -> None:
    flyer = MissionFlyer(TAKEOFF, do(Cmd.CONDITION_YAW, 90.0, 30.0), place(Cmd.DO_SET_ROI_LOCATION, -50, 0, 0), STAY)
    flyer.begin()
    assert flyer.run(60.0, lambda: "Mission: 3 SetROILocation" in flyer.texts())
    assert flyer.yaw_deg == pytest.approx(90.0, abs=2.5)
    flyer.run(10.0)
    assert abs(flyer.yaw_deg) == pytest.approx(180.0, abs=2.0)


def test_home_and_source_set_change_on_the_way() -> None:
    chosen: list[int] = []
    flyer = MissionFlyer(TAKEOFF, place(Cmd.DO_SET_HOME, 5, 0, 1), do(Cmd.DO_AUX_FUNCTION, 90, 2), STAY)
    flyer.rig.vehicle.set_source_set = chosen.append  # type: ignore[method-assign, assignment]
    flyer.begin()
    flyer.run_to(4)
    flyer.run(0.5)
    assert chosen == [2]
    assert flyer.copter.home.place is not None
    assert flyer.copter.home.place.alt_cm == PLACE.alt_cm + 100
    assert "Using EKF Source Set 3" in flyer.texts()


def test_command_that_cannot_be_done_is_left_out() -> None:
    flyer = MissionFlyer(TAKEOFF, do(92, 1.0), do(206, 1.0), do(Cmd.DO_JUMP_TAG, 1.0, 1.0), do(600, 1.0), do(30), STAY)
    flyer.begin()
    flyer.run_to(7)
    flyer.run(0.5)
    assert flyer.texts()[1:] == [
        "Mission: 2 GuidedEnable",
        "Mission: 3 SetCamTrigDst",
        "Mission: 4 Jump 1/1",
        "Mission: 6 ContinueAndChangeAlt",
        "Mission: 7 LoitUnlim",
        "Mission: 5 Tag 0",
    ]


def test_waypoint_that_a_client_changes_is_flown_to_anew() -> None:
    flyer = flown(place(16, 50, 0, 6), STAY)
    flyer.run(1.0)
    assert flyer.mission.put(2, place(16, 0, 20, 6))
    flyer.run(0.1)
    assert flyer.texts() == ["Mission: 2 WP", "Auto mission changed, restarted command"]
    flyer.run_to(3)
    assert flyer.pos == pytest.approx((0.0, 20.0, -6.0), abs=2.5)


def test_mission_resumes_where_it_was_left_or_begins_anew() -> None:
    for restart, begins_with in ((0, "Mission: 2 WP"), (1, "Mission: 1 Takeoff")):
        flyer = flown(place(16, 50, 0, 6), STAY)
        flyer.rig.params.set("MIS_RESTART", restart)
        flyer.set_mode(ModeNumber.GUIDED)
        assert flyer.mission.state is MissionState.STOPPED
        flyer.rig.take_texts()
        flyer.set_mode(ModeNumber.AUTO)
        flyer.run(0.1)
        assert flyer.texts()[0] == begins_with


def test_distance_to_the_target_is_told() -> None:
    flyer = flown(place(16, 30, 40, 6), STAY)
    assert flyer.copter.flight is not None
    assert math.hypot(*flyer.copter.flight.way_to_target()) == pytest.approx(50.0, abs=1.0)


def test_mission_is_not_cleared_while_it_is_flown() -> None:
    flyer = flown(STAY)
    assert not flyer.mission.clear()
    flyer.set_mode(ModeNumber.GUIDED)
    assert flyer.mission.clear()
