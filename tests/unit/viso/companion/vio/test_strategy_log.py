# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The events of a strategy: their levels, texts and fields."""

import logging

import pytest

from tests.unit.viso.companion.vio.strategy_rig import (
    EventHandler,
    Ticks,
    make_frame,
    make_logger,
    make_output,
    make_warm_start,
)
from viso.companion.vio.strategy_log import StrategyLog
from viso.companion.vio.types import VioState

OUTPUT = make_output(make_frame(1))


class Rig:
    def __init__(self, level: int = logging.DEBUG) -> None:
        logger, self.handler = make_logger(level)
        self.clock = Ticks()
        self.log = StrategyLog("klt_ransac", logger, self.clock)

    def only(self, event: str) -> tuple[int, str, dict[str, object]]:
        (record,) = self.handler.events(event)
        return record.levelno, record.getMessage(), self.handler.fields(event)[0]


def names(handler: EventHandler) -> list[str]:
    return [getattr(record, "event") for record in handler.records]  # noqa: B009 -- typed as having none


def test_state_change_is_info() -> None:
    rig = Rig()
    rig.log.state_change(VioState.TRACKING, VioState.DEGRADED, "imu_gap", 0)
    fields = {"old": "TRACKING", "new": "DEGRADED", "reason": "imu_gap"}
    assert rig.only("state_change") == (logging.INFO, "TRACKING -> DEGRADED: imu_gap", fields)


def test_lost_is_an_error_too() -> None:
    rig = Rig()
    rig.log.state_change(VioState.DEGRADED, VioState.LOST, "no_model", 9)
    fields = {"consecutive_lost": 9, "reason": "no_model"}
    text = "VIO LOST after 9 consecutive frames; strategy=klt_ransac"
    assert rig.only("vio_lost") == (logging.ERROR, text, fields)
    assert names(rig.handler) == ["state_change", "vio_lost"]


def test_warm_start_tells_where() -> None:
    rig = Rig()
    pose = make_warm_start()
    rig.log.warm_start_applied(pose)
    level, _, fields = rig.only("warm_start_applied")
    assert level == logging.INFO
    assert fields["position_enu"] == pytest.approx(pose.body_T_world.inverse().t)


def test_degraded_tells_what_is_wrong() -> None:
    rig = Rig()
    rig.log.degraded(OUTPUT, "low_coverage")
    level, text, fields = rig.only("vio_degraded")
    assert (level, text) == (logging.WARNING, "VIO degraded: low_coverage")
    assert fields == {
        "parallax": 4.5,
        "mre": 0.5,
        "bias_norm": OUTPUT.imu_bias.norm(),
        "reason": "low_coverage",
        "suppressed": 0,
    }


def test_degraded_at_most_once_a_second() -> None:
    rig = Rig()
    for now_ns in (0, 333_000_000, 999_999_999, 1_000_000_000):
        rig.clock.now_ns = now_ns
        rig.log.degraded(OUTPUT, "low_coverage")
    assert [fields["suppressed"] for fields in rig.handler.fields("vio_degraded")] == [0, 2]


def test_frame_is_for_debugging() -> None:
    rig = Rig()
    rig.log.frame(OUTPUT, {"track": 3.5})
    fields = {"tracked": 120, "new": 5, "keyframe": True, "ms": {"track": 3.5}}
    assert rig.only("frame") == (logging.DEBUG, "frame", fields)


def test_frame_costs_nothing_when_nobody_debugs() -> None:
    rig = Rig(logging.INFO)
    rig.log.frame(OUTPUT, {})
    assert rig.handler.records == []


def test_each_event_names_the_strategy() -> None:
    rig = Rig()
    rig.log.degraded(OUTPUT, "low_coverage")
    (record,) = rig.handler.events("vio_degraded")
    assert (record.__dict__["strategy"], record.__dict__["frame"]) == ("klt_ransac", OUTPUT.frame_id)
