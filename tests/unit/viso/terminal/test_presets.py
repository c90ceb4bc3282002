# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The presets: what they set, and that a vehicle with one wants its stream and is content with it."""

import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
import quaternion

from ap_core.parm_file import parse_parm
from mav_handlers.links.pair import make_pair
from mav_handlers.wire.messages import ATT_POS_MOCAP, ODOMETRY, VISION_POSITION_ESTIMATE, Message
from viso.companion.sender import Companion
from viso.companion.simulated_camera import Flight, SimulatedCamera
from viso.errors import InputError
from viso.running.virtual_time import Scheduler
from viso.terminal.settings import PRESETS, load_settings, preset_files, preset_title
from viso.vehicle.vehicle import LOOP_PERIOD_US, Vehicle, VehicleConfig, bench

NORTH_RAD = 0.0
CAMERA_TURNED_RAD = math.radians(-75)
START_S = 3.0
SETTLED_S = 24.0
BOOTED_S = 4.0

Estimate = Callable[[int], Message | None]


def camera(frame_yaw_rad: float) -> Callable[[int], ODOMETRY | None]:
    """Return the reports of a camera on a vehicle that stays on the ground, heading north."""
    flight = Flight(start_s=1e6, heading_rad=NORTH_RAD)
    return SimulatedCamera(flight, seed=1, frame_yaw_rad=frame_yaw_rad).report


def as_pose(report: Callable[[int], ODOMETRY | None]) -> Estimate:
    """Return the same as VISION_POSITION_ESTIMATE."""

    def estimate(true_us: int) -> Message | None:
        odometry = report(true_us)
        assert odometry is not None
        roll, pitch, yaw = euler(odometry.q)
        return VISION_POSITION_ESTIMATE(odometry.time_usec, odometry.x, odometry.y, odometry.z, roll, pitch, yaw)

    return estimate


def as_mocap(report: Callable[[int], ODOMETRY | None]) -> Estimate:
    """Return the same as ATT_POS_MOCAP."""

    def estimate(true_us: int) -> Message | None:
        odometry = report(true_us)
        assert odometry is not None
        return ATT_POS_MOCAP(odometry.time_usec, odometry.q, odometry.x, odometry.y, odometry.z)

    return estimate


def euler(q: tuple[float, ...]) -> tuple[float, float, float]:
    matrix = quaternion.as_rotation_matrix(quaternion.quaternion(*q))
    roll = math.atan2(matrix[2, 1], matrix[2, 2])
    return roll, -math.asin(matrix[2, 0]), math.atan2(matrix[1, 0], matrix[0, 0])


STREAMS: dict[str, Callable[[], Estimate]] = {
    "gps-and-extnav": lambda: camera(CAMERA_TURNED_RAD),
    "mavlink-camera-rover": lambda: as_pose(camera(NORTH_RAD)),
    "motion-capture": lambda: as_mocap(camera(NORTH_RAD)),
    "t265-compass": lambda: camera(CAMERA_TURNED_RAD),
    "t265-indoors": lambda: as_pose(camera(NORTH_RAD)),
    "voxl": lambda: camera(NORTH_RAD),
}


class Run:
    """A vehicle with a preset that runs for a while, and what it says; with or without the stream."""

    def __init__(self, name: str, estimate: Estimate | None, duration_s: float) -> None:
        settings = load_settings(preset_files(name), [], links=1)
        self.vehicle = Vehicle(VehicleConfig(bench(math.degrees(NORTH_RAD)), defaults=settings))
        self.texts: list[str] = []
        self.vehicle.texts.on_text.append(lambda _severity, text: self.texts.append(text))
        scheduler = Scheduler(self.vehicle)
        channel = self.vehicle.endpoint.open_channel("companion")
        wire, companion_wire = make_pair(("autopilot", "companion"))
        companion = Companion(companion_wire, estimate or (lambda _true_us: None), start_us=round(START_S * 1e6))
        for now_us in range(0, round(duration_s * 1e6), LOOP_PERIOD_US):
            scheduler.run_until(now_us)
            companion.run(now_us)
            while data := wire.receive():
                scheduler.deliver(channel, data)
            self.vehicle.endpoint.bytes_to_send(channel)
        self.vehicle.copter.arming.pre_arm_checks(display=True)


@pytest.fixture(scope="module")
def settled() -> Callable[[str], Run]:
    """Return a function that lets a vehicle with a preset and its stream settle, once for all tests."""
    return cache(lambda name: Run(name, STREAMS[name](), SETTLED_S))


def test_every_preset_has_a_stream_here() -> None:
    assert list(STREAMS) == list(PRESETS)


@pytest.mark.slow
@pytest.mark.parametrize("name", STREAMS)
def test_vehicle_with_its_stream_is_ready_to_arm(settled: Callable[[str], Run], name: str) -> None:
    run = settled(name)
    assert [text for text in run.texts if text.startswith("PreArm")] == []
    assert run.vehicle.copter.arming.passed


@pytest.mark.parametrize("name", STREAMS)
def test_vehicle_without_its_stream_is_not(name: str) -> None:
    run = Run(name, None, BOOTED_S)
    assert "PreArm: VisOdom: not healthy" in run.texts
    assert not run.vehicle.copter.arming.passed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["t265-compass", "gps-and-extnav"])
def test_camera_is_aligned_where_the_heading_is_the_compass(settled: Callable[[str], Run], name: str) -> None:
    texts = settled(name).texts
    assert any(re.fullmatch(r"VisOdom: yaw shifted 7[45] to (?:0|1|359) deg", text) for text in texts), texts


@pytest.mark.parametrize("path", PRESETS.values(), ids=PRESETS)
def test_every_value_has_its_reason(path: Path) -> None:
    values = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    # The second and third compass go with the first.
    unexplained = [line for line in values if "#" not in line and not re.match(r"COMPASS_USE[23] ", line)]
    assert not unexplained


@pytest.mark.parametrize("path", PRESETS.values(), ids=PRESETS)
def test_nothing_is_set_twice(path: Path) -> None:
    names = [line.name for line in parse_parm(path.read_text(), path.name)]
    assert len(names) == len(set(names))


@pytest.mark.parametrize("path", PRESETS.values(), ids=PRESETS)
def test_files_hold_no_more_than_a_name_a_number_and_a_comment(path: Path) -> None:
    lines = [line.split("#")[0] for line in path.read_text().splitlines()]
    assert all(re.fullmatch(r"([A-Z0-9_]+ +-?[\d.]+ *)?", line) for line in lines)


def test_no_name_is_no_file() -> None:
    assert preset_files(None) == []


def test_unknown_name_is_one_line_that_lists_the_names() -> None:
    with pytest.raises(InputError) as error:
        preset_files("t256")
    assert str(error.value) == f"--preset t256: no such preset; there are {', '.join(PRESETS)}"


def test_title_is_the_comment_on_top() -> None:
    assert preset_title(PRESETS["voxl"]).startswith("ModalAI VOXL: ")
    assert "This emulator is a Copter and stays one" in preset_title(PRESETS["mavlink-camera-rover"])
    assert not [path for path in PRESETS.values() if not preset_title(path)]


def test_title_of_a_file_without_values_is_all_of_its_comment(tmp_path: Path) -> None:
    (tmp_path / "empty.parm").write_text("# header\n# header\n# nothing\n# yet")
    assert preset_title(tmp_path / "empty.parm") == "nothing yet"


def test_files_of_the_user_win_over_the_preset(tmp_path: Path) -> None:
    mine = tmp_path / "mine.parm"
    mine.write_text("VISO_QUAL_MIN 30\n")
    settings = load_settings([*preset_files("voxl"), mine], [], links=1)
    assert (settings["VISO_QUAL_MIN"], settings["VISO_TYPE"]) == (30, 3)
