# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A flight whose log has no replay records is flown again near enough to find delay and lever arm of its camera.

Its poses are 23 ms old by stamps of ``--baud 0``, as the simulator's own states show; it flew with a delay of 50 ms in
these terms, and its camera was where its IMU was.
"""

import lzma
from pathlib import Path

import pytest

from tests.places import DATA
from viso.firmware.releases import JULY_2025
from viso.logs.recorded import read_columns
from viso.sweep.best import Best
from viso.sweep.job import run_point
from viso.sweep.planning import make_plan
from viso.sweep.request import SweepRequest
from viso.sweep.result_tables import found
from viso.sweep.store import table_rows
from viso.vehicle.sensors.flight import Basis

LOG = DATA / "ordinary" / "lane_switch.BIN.xz"
AGE_MS = 23.3
END_S = 82.0

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def without_imu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log without its IMU records."""
    log, data = read_columns(LOG), lzma.decompress(LOG.read_bytes())
    ends = [*log.begins[1:].tolist(), len(data)]
    kept = log.sequence != log.types["IMU"].msg_type
    records = (data[begin:end] for begin, end, is_kept in zip(log.begins, ends, kept, strict=True) if is_kept)
    path = tmp_path_factory.mktemp("logs") / "without_imu.BIN.xz"
    path.write_bytes(lzma.compress(b"".join(records), preset=0))
    return path


def best(log: Path, axis: str) -> Best:
    plan = make_plan(SweepRequest(streams=[log], set=[axis], baud=0, until=END_S))
    rows = table_rows(plan, {point.number: run_point(plan, point).row or {} for point in plan.points()})
    (along,) = found(plan, rows, "nis")
    return along


def test_delay_of_the_camera_is_found_by_imu_records(without_imu: Path) -> None:
    delay = best(LOG, "VISO_DELAY_MS=0:60:20")
    assert delay.stands_out
    assert delay.vertex == pytest.approx(AGE_MS, abs=10)
    leaning = best(without_imu, "VISO_DELAY_MS=0:60:20")
    assert leaning.vertex == pytest.approx(AGE_MS, abs=10)


def test_lever_arm_is_found_by_imu_records() -> None:
    lever = best(LOG, "VISO_POS_X=-0.2:0.2:0.2")
    assert lever.stands_out
    assert lever.vertex == pytest.approx(0.0, abs=0.05)


def test_estimate_is_that_of_the_flight(without_imu: Path) -> None:
    for log, basis, most_m in ((LOG, Basis.IMU, 0.1), (without_imu, Basis.ESTIMATE, 0.3)):
        request = SweepRequest(streams=[log], set=["VISO_QUAL_MIN=0,100"], until=END_S, firmware=[JULY_2025.name])
        plan = make_plan(request)
        (recorded,) = plan.recordings
        assert recorded.basis is basis
        row = run_point(plan, next(plan.points())).row
        assert row is not None
        assert row["log_m"] < most_m
