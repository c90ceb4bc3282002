# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Trajectories for other tools; those tools read them."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from evo.core import metrics, sync  # type: ignore[import-untyped]  # evo ships no type information
from evo.tools import file_interface  # type: ignore[import-untyped]  # as above
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader

from tests.unit.viso.report.log_maker import LogMaker, material_of
from viso.report.agreement import Poses
from viso.report.exports import (
    EKF_TOPIC,
    VISION_TOPIC,
    csv_text,
    in_ros_axes,
    mcap_bytes,
    trajectories,
    tum_text,
    usable,
)
from viso.report.flight_data import Material
from viso.streams.bag_formats import bag_records


@pytest.fixture(scope="module")
def bag(material: Material, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the trajectories as MCAP."""
    path = tmp_path_factory.mktemp("bag") / "flight.mcap"
    path.write_bytes(mcap_bytes(material, lambda done, total: None))
    return path


def error_m(reference: Any, estimate: Any) -> float:
    """Return evo's absolute pose error, as rms, of trajectories whose times are 20 ms apart at most."""
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(sync.associate_trajectories(reference, estimate, max_diff=0.02))
    return float(ape.get_statistic(metrics.StatisticsType.rmse))


def test_evo_compares_vision_and_ekf(material: Material, tmp_path: Path) -> None:
    for name, poses in trajectories(material).items():
        (tmp_path / f"{name}.tum").write_text(tum_text(poses))
    vision, ekf = (file_interface.read_tum_trajectory_file(tmp_path / f"{name}.tum") for name in ("vision", "ekf"))
    assert vision.check()[0]
    assert (vision.num_poses, ekf.num_poses) == (209, 110)
    before, after = (one.reduce_to_time_range for one in (vision, ekf))
    before(1.0, 8.9)
    after(1.0, 8.9)
    assert error_m(ekf, vision) < 0.02  # half a metre a second, for the time between their stamps


def test_evo_reads_the_bag(material: Material, bag: Path) -> None:
    with Reader(bag) as reader:
        for topic, name in ((VISION_TOPIC, "vision"), (EKF_TOPIC, "ekf")):
            found = file_interface.read_bag_trajectory(reader, topic)
            assert found.num_poses == len(trajectories(material)[name].time_s)
            assert found.positions_xyz[0, 1] == pytest.approx(trajectories(material)[name].pos_ned[0, 0], abs=1e-9)


def test_bag_describes_its_messages_and_is_in_order(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        assert all(connection.msgdef.data for connection in reader.connections)
        times = [time_ns for _, time_ns, _ in reader.messages()]
        assert times == sorted(times)
        (odometry,) = [one for one in reader.connections if one.topic == EKF_TOPIC]
        _, _, data = next(reader.messages([odometry]))
        message: Any = reader.deserialize(data, odometry.msgtype)
    assert (message.header.frame_id, message.child_frame_id) == ("map", "base_link")
    # Half a metre a second north, heading 350 deg: forward, and a little to the right.
    velocity = message.twist.twist.linear
    assert (velocity.x, velocity.y, velocity.z) == pytest.approx((0.4924, -0.0868, 0.0), abs=1e-4)


def test_bag_is_what_this_project_plays(bag: Path) -> None:
    assert len(bag_records(bag, VISION_TOPIC).times_ns) == 209


def test_axes_are_those_of_ros() -> None:
    poses = Poses(
        np.array([1.0]), np.array([[1.0, 2.0, 3.0]]), np.array([[0.0, 0.0, 90.0]]), np.array([[0.0, 4.0, 0.0]])
    )
    ((time_s, pos, quat, vel),) = in_ros_axes(poses)
    assert (time_s, pos.tolist()) == (1.0, [2.0, 1.0, -3.0])
    np.testing.assert_allclose(np.abs(quat), [1, 0, 0, 0], atol=1e-12)  # facing east, along x
    np.testing.assert_allclose(vel, [4.0, 0.0, 0.0], atol=1e-12)


def test_trajectory_leaves_out_what_is_no_pose_and_repeated_times() -> None:
    nan = np.nan
    positions = np.array([[0.0, 0, 0], [nan, 0, 0], [2.0, 0, 0], [3.0, 0, 0]])
    found = usable(Poses(np.array([1.0, 2.0, 1.0, 0.5]), positions, np.zeros((4, 3)), positions))
    assert (found.time_s.tolist(), found.pos_ned[:, 0].tolist()) == ([0.5, 1.0], [3.0, 0.0])


def test_table_has_vision_beside_the_ekf(material: Material) -> None:
    rows = list(csv.DictReader(io.StringIO(csv_text(material))))
    assert len(rows) == 209
    row = rows[40]
    assert float(row["vision_north_m"]) == pytest.approx(float(row["ekf_north_m"]), abs=1e-3)
    assert (row["lag_ms"], row["quality"], row["withheld"]) == ("20", "80", "0")
    assert rows[0]["ekf_north_m"] == ""  # before the first record of the EKF


def test_table_without_vision_is_the_ekfs(tmp_path: Path) -> None:
    maker = LogMaker()
    maker.add("XKF1", 1.0, PN=7.0)
    rows = list(csv.DictReader(io.StringIO(csv_text(material_of(maker, tmp_path / "a.BIN")))))
    assert [(row["time_s"], row["vision_north_m"], row["ekf_north_m"]) for row in rows] == [("1", "", "7")]
