# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A sweep of VISO_DELAY_MS finds how late a camera is, where it is known and on a recorded flight."""

from pathlib import Path
from typing import Any

import pytest

from tests.places import RECORDED
from tests.unit.viso.sweep.late_camera import late_camera
from viso.sweep.best import Best
from viso.sweep.job import run_point
from viso.sweep.planning import make_plan
from viso.sweep.request import SweepRequest
from viso.sweep.result_tables import age_ms, found
from viso.sweep.store import table_rows

pytestmark = pytest.mark.slow

BY_GYRO_MS = 26.3
"""Age of the flight's poses on arrival, by ``estimate_delay`` with its gyroscopes: +-0.7 ms."""
STEP_MS = 12.5
"""Of the filter: it cannot tell delays apart by much less than half of it."""


def best_delay(**options: Any) -> Best:
    """Return the point of a sweep at which innovations are least."""
    plan = make_plan(SweepRequest(baud=0, **options))
    rows = table_rows(plan, {point.number: run_point(plan, point).row or {} for point in plan.points()})
    (best,) = found(plan, rows, "nis")
    return best


def test_delay_that_is_known_is_found(tmp_path: Path) -> None:
    delay_ms = 30.0
    files = late_camera(tmp_path, delay_ms, end_s=11.0)
    values = f"VISO_DELAY_MS={delay_ms - 20:g}:{delay_ms + 20:g}:20"
    best = best_delay(streams=[files.capture], imu=f"script:{files.script}", set=[values])
    assert best.at == delay_ms
    assert age_ms(best) == pytest.approx(delay_ms, abs=STEP_MS / 2)


def test_delay_of_the_recorded_flight_is_found() -> None:
    best = best_delay(
        streams=[RECORDED / "captures" / "flight_t265.jsonl.gz"],
        imu=f"log:{RECORDED}/logs/{{name}}.BIN.xz",
        set=["VISO_DELAY_MS=0:40:20"],
        until=55.0,
    )
    assert best.at == 20.0
    assert age_ms(best) == pytest.approx(BY_GYRO_MS, abs=STEP_MS / 2)
