# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pages are told, made from a whole vehicle in virtual time."""

import json
import math
from collections.abc import Callable
from typing import Any

import pytest

from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from mav_handlers.links.pair import make_pair
from mav_handlers.wire.messages import HEARTBEAT
from tests.unit.viso.conftest import Bench, odometry
from viso.web.faults import FaultSwitches
from viso.web.feed import Feed
from viso.web.live_state import LiveState
from viso.web.requests import RequestQueue
from viso.web.server import encode

INDOORS = {
    "VISO_TYPE": 1.0,
    "EK3_SRC1_POSXY": 6.0,
    "EK3_SRC1_VELXY": 6.0,
    "EK3_SRC1_POSZ": 6.0,
    "EK3_SRC1_VELZ": 6.0,
    "EK3_SRC1_YAW": 6.0,
    "COMPASS_USE": 0.0,
}


class Watched:
    """A vehicle, its feed, and the state that pages get."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        switches = FaultSwitches([])
        self.link, self.client = make_pair(("a link", "a client"))
        self.feed = Feed(
            RequestQueue(switches), switches, links=[self.link], now_s=lambda: bench.scheduler.now_us / 1e6
        )
        self.state = LiveState("a banner", lambda: self.feed.updates.lost)
        vehicle = bench.vehicle
        vehicle.endpoint.on_event = lambda event: self.feed.take("client", event)
        assert isinstance(vehicle.ahrs, Ekf3Ahrs)
        vehicle.ahrs.on_filter_outcome = lambda outcome: self.feed.take_outcome(vehicle.clock.micros64(), outcome)
        self.feed.watch(vehicle)

    def batch(self) -> dict[str, Any]:
        """Look at the vehicle, and return what a page is told."""
        self.feed.update()
        self.state.take(self.feed.updates.take_all())
        batch = json.loads(encode(self.state.batch()))
        assert isinstance(batch, dict)
        return batch


@pytest.fixture
def watch(make_bench: Callable[..., Bench]) -> Callable[..., Watched]:
    """Return a function that makes a booted vehicle from parameters, and watches it."""
    return lambda **params: Watched(make_bench(**{**INDOORS, **params}))


def rows(batch: dict[str, Any], link: str = "client") -> list[tuple[str, str, str, int]]:
    """Return name, outcome, rule and count of each row of messages."""
    return [(run["name"], run["outcome"], run["rule"], run["count"]) for run in batch["runs"] if run["link"] == link]


@pytest.mark.slow
def test_clients_are_shown_while_they_are_connected(watch: Callable[..., Watched]) -> None:
    watched = watch()
    assert watched.batch()["state"]["clients"] == [["a link", "a client"]]
    watched.client.close()
    watched.feed.take_news("a link", "a client left")
    watched.bench.run_for(0.2)
    batch = watched.batch()
    assert batch["state"]["clients"] == []
    assert batch["texts"][-1][1:] == [6, "a link: a client left"]


def test_dropped_odometry_is_told_with_its_reason(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(0.5, frame_id=1)
    (run,) = watched.batch()["runs"]
    assert (run["name"], run["outcome"], run["count"], run["sender"]) == ("ODOMETRY", "dropped", 10, "255:190")
    assert run["reason"] == "frame_id must be 20 (LOCAL_FRD) and child_frame_id 12 (BODY_FRD)"
    assert run["source"] == "GCS_Common.cpp, GCS_MAVLINK::handle_odometry"


@pytest.mark.slow
def test_rates_tell_what_the_filter_used(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(4)
    (rate,) = watched.batch()["rates"]
    assert rate["name"] == "ODOMETRY"
    assert rate["per_s"]["offered"] == rate["per_s"]["accepted"] == pytest.approx(20, abs=1)
    assert 0 < rate["total"]["fused"] <= rate["total"]["accepted"] == 80


def test_dropped_messages_are_offered_and_never_fused(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(2, child_frame_id=1)
    (rate,) = watched.batch()["rates"]
    assert rate["total"] == {
        "offered": 40, "accepted": 0, "ignored": 0, "dropped": 40, "handled": 0, "fused": 0,
    }  # fmt: skip


@pytest.mark.slow
def test_rates_go_back_to_nothing_when_nothing_comes(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(1)
    watched.bench.run_for(3)
    (rate,) = watched.batch()["rates"]
    assert rate["per_s"]["offered"] == 0
    assert rate["total"]["offered"] == 20


@pytest.mark.slow
def test_path_and_innovations_follow_vision_and_filter(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(4, x=0.5, z=-0.25)
    watched.batch()
    watched.bench.see(0.5, x=0.5, z=-0.25)
    point = watched.batch()["point"]
    assert point["vision"] == {"pos": [0.5, 0.0, -0.25], "ignored": False}
    assert point["ekf"] == pytest.approx([0.5, 0.0, -0.25], abs=0.1)
    pose = point["innovations"]["pose"]
    assert pose["tested"] > 0
    assert pose["value"] / pose["gate"] == pytest.approx(pose["ratio"], rel=0.05, abs=1e-3)


@pytest.mark.slow
def test_sample_that_is_rejected_is_counted_with_its_innovation(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(4)
    watched.batch()
    watched.bench.see(0.5, x=50.0)
    batch = watched.batch()
    pose = batch["point"]["innovations"]["pose"]
    assert pose["rejected"] > 0
    assert pose["ratio"] > 1
    assert pose["value"] == pytest.approx(50, abs=1)
    assert ("pose", "rejected", "model_gate_position") in [row[:3] for row in rows(batch, "filter")]


@pytest.mark.slow
def test_ignored_sample_is_marked_in_the_path(watch: Callable[..., Watched]) -> None:
    watched = watch(VISO_QUAL_MIN=50.0)
    watched.bench.see(0.2, quality=10)
    batch = watched.batch()
    assert batch["point"]["vision"]["ignored"] is True
    assert rows(batch)[0][1] == "ignored"


def test_lag_is_the_time_since_the_corrected_stamp(watch: Callable[..., Watched]) -> None:
    watched = watch()
    bench = watched.bench
    for late_us in (0, 0, 40_000):
        bench.run_for(0.1)
        bench.send(odometry(bench.scheduler.now_us - late_us))
    assert watched.batch()["point"]["lag"] == [pytest.approx(0, abs=1), pytest.approx(40, abs=1)]
    assert watched.batch()["point"]["lag"] is None


@pytest.mark.parametrize("arrived_ms", [30, 5], ids=["both after the wrap", "stamp before the wrap"])
def test_lag_survives_the_wrap_of_the_corrected_stamp_after_49_days(arrived_ms: int) -> None:
    state = LiveState("a banner")
    state.take_record(False, (((1 << 32) + arrived_ms) * 1000 + 500, 0, (arrived_ms - 20) % (1 << 32), 0, 0))
    assert state.batch()["point"]["lag"] == [20.5, 20.5]


def test_quality_is_the_median_and_the_worst_of_what_came() -> None:
    state = LiveState("a banner")
    for quality in (90, -1, 80):
        state.take_record(False, (0, 0, 0, 0, quality))
    assert state.batch()["point"]["quality"] == [80, -1]
    assert state.batch()["point"]["quality"] is None


def test_numbers_that_are_none_become_null(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(0.2, x=math.nan)
    assert watched.batch()["point"]["vision"]["pos"] is None


@pytest.mark.slow
def test_failed_checks_stand_until_they_pass(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.vehicle.copter.arming.pre_arm_checks(display=True)
    state = watched.batch()["state"]
    assert state["prearm"] is False
    assert "VisOdom: not healthy" in state["failures"]
    assert (state["camera"], state["armed"], state["source_set"]) == ("not healthy", False, 0)
    watched.bench.see(3)
    watched.bench.vehicle.copter.arming.pre_arm_checks(display=True)
    state = watched.batch()["state"]
    assert (state["prearm"], state["failures"], state["camera"]) == (True, [], "healthy")
    assert state["aiding"] == "absolute"


def test_parameters_come_once_and_then_as_they_change(watch: Callable[..., Watched]) -> None:
    watched = watch()
    table = {row["name"]: row for row in watched.batch()["table"]}
    assert table["VISO_TYPE"]["value"] == table["VISO_TYPE"]["default"] == 1
    assert table["VISO_TYPE"]["reboot"] is True
    watched.bench.run_for(0.2)
    watched.bench.set("VISO_POS_M_NSE", 0.3)
    watched.bench.run_for(0.2)
    batch = watched.batch()
    assert batch["table"] is None
    assert batch["params"] == {"VISO_POS_M_NSE": 0.3}


def test_parameters_that_appear_bring_the_whole_table(watch: Callable[..., Watched]) -> None:
    watched = watch(EK3_ENABLE=0.0)
    before = len(watched.batch()["table"])
    watched.bench.set("EK3_ENABLE", 1)
    watched.bench.run_for(0.2)
    assert len(watched.batch()["table"]) > before


def test_restart_forgets_paths_and_keeps_verdicts_and_totals(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.see(1)
    watched.batch()
    watched.state.take_boot({}, "")
    batch = watched.batch()
    assert batch["boots"] == 2
    assert batch["rates"][0]["total"]["offered"] == 20
    assert [text for *_, text in batch["texts"]] == ["— restart —"]
    everything = watched.state.snapshot()
    assert len(everything["points"]) == 1
    assert [run["name"] for run in everything["runs"] if run["link"] == "client"] == ["ODOMETRY"]


def test_page_that_opens_gets_what_batches_have_told(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.bench.send(HEARTBEAT(6, 8, 0, 0, 4, 3))
    watched.bench.vehicle.texts.send_text(4, "a text")
    batch = watched.batch()
    everything = json.loads(encode(watched.state.snapshot()))
    for name in ("boots", "lost", "state", "runs", "rates", "texts", "table"):
        assert everything[name] == batch[name]
    assert everything["points"] == [batch["point"]]
    assert everything["banner"] == "a banner"


def test_what_is_too_much_is_counted_and_told(watch: Callable[..., Watched]) -> None:
    watched = watch()
    watched.feed.updates._limit = 3
    watched.bench.see(0.5)
    assert watched.batch()["lost"] > 0


def test_time_of_a_vehicle_without_a_filter_goes_on(watch: Callable[..., Watched]) -> None:
    watched = watch(EK3_ENABLE=0.0)
    watched.bench.run_for(0.5)
    batch = watched.batch()
    assert batch["state"]["aiding"] is None
    assert batch["point"]["t"] == pytest.approx(6.5, abs=0.01)
