# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The telemetry record of an update."""

from dataclasses import replace

import pytest

from tests.unit.viso.companion.vio.strategy_rig import make_frame, make_output
from viso.companion.vio.strategy import FrameReport
from viso.companion.vio.telemetry_records import output_values
from viso.companion.vio.types import VioHealth, VioState
from viso.companion.vio.update import VioUpdate, update_record

FRAME = make_frame(5)
OUTPUT = make_output(FRAME)
UPDATE = VioUpdate(
    FRAME.frame_id,
    5,
    1234,
    OUTPUT,
    VioHealth(VioState.DEGRADED, 1, 0.5, "no_model"),
    FrameReport(1.5, 2, {"total": 3.5}),
    7,
)


def test_record_has_all_of_it() -> None:
    assert update_record(UPDATE, -99) == {
        "kind": "frame",
        "frame_id": str(FRAME.frame_id),
        "sequence": 5,
        "t_ns": 1234,
        "health": {"state": "DEGRADED", "consecutive_lost": 1, "bias_norm": 0.5, "reason": "no_model"},
        "output": output_values(OUTPUT),
        "innovation_ratio": 1.5,
        "resets": 2,
        "stage_ms": {"total": 3.5},
        "dropped": 7,
        "clock_offset_ns": -99,
        "clock_synced": True,
    }


def test_record_without_output() -> None:
    assert update_record(replace(UPDATE, output=None), 0)["output"] is None


@pytest.mark.parametrize(("offset_ns", "synced"), [(None, False), (0, True)])
def test_record_tells_whether_the_clock_is_synced(offset_ns: int | None, synced: bool) -> None:
    record = update_record(UPDATE, offset_ns)
    assert (record["clock_offset_ns"], record["clock_synced"]) == (offset_ns, synced)
