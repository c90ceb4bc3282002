# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures of a replay that are worked out here: what they are made of, and where they have nothing to say."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

from ap_core.verdict import VerdictKind
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.inputs import ingest_rules as rules
from ekf_stub.inputs.ingest_rules import FilterOutcome
from ekf_stub.reports import AidingMode
from viso.geometry.trajectory import Trajectory
from viso.replay.figures import BY_TIME, LOWER_IS_BETTER, OBJECTIVES, Judge, Row
from viso.replay.run import ReplayOutcome, SaidText
from viso.vehicle.outcomes import AidingSpan, FilterWatch, SampleTest
from viso.vehicle.vehicle import Vehicle, VehicleConfig


def outcome(**values: Any) -> ReplayOutcome:
    usual: dict[str, Any] = {
        "verdicts": {},
        "texts": (),
        "filter_counts": {},
        "params": {},
        "unknown_params": (),
        "aiding": (),
    }
    return ReplayOutcome(**{**usual, **values})


def row(**values: Any) -> Row:
    return Judge().row(outcome(**values))


def of_sample(ratio: float | None, innovation: float | None = 1.0, kind: str = "pose") -> SampleTest:
    return SampleTest(0, FilterOutcome(kind, rules.FUSED, 0, ratio, innovation))


@pytest.fixture
def vehicle() -> Vehicle:
    return Vehicle(VehicleConfig())


def judged(vehicle: Vehicle, *tests: SampleTest, truth: Trajectory | None = None) -> Row:
    judge, watch = Judge(truth), FilterWatch(vehicle)
    judge.start(vehicle, watch)
    for test in tests:
        for listener in watch.listeners:
            listener(test)
    return judge.row(outcome())


def test_every_row_has_every_column_and_nothing_else() -> None:
    assert list(row()) == [*OBJECTIVES, BY_TIME]
    assert set(OBJECTIVES) >= LOWER_IS_BETTER


def test_normalised_innovation_is_the_ratio_in_standard_deviations(vehicle: Vehicle) -> None:
    found = judged(vehicle, of_sample(0.2, 3.0), of_sample(0.4, 4.0), of_sample(0.1, 0.5, "velocity"))
    assert found["nis_pose"] == pytest.approx(((0.2 * 5) ** 2 + (0.4 * 5) ** 2) / 2)
    assert found["nis_velocity"] == pytest.approx((0.1 * 5) ** 2)
    assert found["nis"] == pytest.approx((1.0 + 4.0 + 0.25) / 3)
    assert found["rms_pose"] == pytest.approx(12.5**0.5)
    assert (found["tested"], found["worst_ratio"], found["nis_yaw"]) == (3, 0.4, None)


def test_gate_is_that_of_the_moment(vehicle: Vehicle) -> None:
    judge, watch = Judge(), FilterWatch(vehicle)
    judge.start(vehicle, watch)
    (listener,) = watch.listeners
    listener(of_sample(0.5))
    vehicle.params.set("EK3_POS_I_GATE", 250)
    listener(of_sample(0.5))
    assert judge.row(outcome())["nis"] == pytest.approx((2.5**2 + 1.25**2) / 2)


def test_samples_that_no_number_was_worked_out_of_do_not_count(vehicle: Vehicle) -> None:
    found = judged(vehicle, of_sample(None), of_sample(float("inf")), of_sample(float("nan")), of_sample(0.1, None))
    assert (found["tested"], found["nis"]) == (0, None)


def test_messages_are_those_of_external_navigation() -> None:
    verdicts = Counter(
        {
            ("ODOMETRY", VerdictKind.ACCEPTED, "a"): 6,
            ("ODOMETRY", VerdictKind.IGNORED, "b"): 2,
            ("ODOMETRY", VerdictKind.DROPPED, "c"): 2,
            ("HEARTBEAT", VerdictKind.HANDLED, "d"): 50,
            ("BAD_DATA", VerdictKind.DROPPED, "e"): 50,
        }
    )
    found = row(verdicts=verdicts, texts=(SaidText(0, 6, "fine"), SaidText(0, 4, "not so"), SaidText(0, 2, "bad")))
    assert [found[name] for name in ("messages", "accepted_share", "ignored", "dropped")] == [10, 0.6, 2, 2]
    assert (found["texts"], found["warnings"]) == (3, 2)
    assert row()["accepted_share"] is None


def test_what_is_withheld_counts_against_the_filter_what_it_has_no_use_for_does_not() -> None:
    counts = {
        ("pose", rules.TAKEN.code): 99,
        ("pose", rules.FUSED.code): 6,
        ("pose", rules.RESET_TO.code): 1,
        ("pose", rules.GATE_POSITION.code): 2,
        ("pose", rules.OVERWRITTEN.code): 1,
        ("yaw", rules.UNUSED.code): 99,
        ("velocity", rules.NOT_STARTED.code): 4,
    }
    verdicts = {("ODOMETRY", VerdictKind.ACCEPTED, "a"): 3, ("ODOMETRY", VerdictKind.IGNORED, "b"): 1}
    found = row(filter_counts=counts, verdicts=verdicts)
    assert found["fused_share"] == 7 / 14 * 3 / 4
    assert [found[name] for name in ("rejected", "lost", "refused", "resets")] == [2, 1, 4, 1]
    assert row()["fused_share"] is None
    assert row(verdicts=verdicts)["fused_share"] == 0.0


def test_aiding_is_counted_from_when_it_began() -> None:
    none, absolute, relative = AidingMode.NONE, AidingMode.ABSOLUTE, AidingMode.RELATIVE
    spans = [(0, 5, none), (5, 7, absolute), (7, 10, none), (10, 14, relative), (14, 15, none)]
    found = row(aiding=tuple(AidingSpan(a * 1_000_000, b * 1_000_000, mode) for a, b, mode in spans))
    assert (found["time_to_aiding_s"], found["aiding_share"], found["aiding_losses"]) == (5.0, 0.6, 2)
    found = row(aiding=(AidingSpan(0, 9, none),))
    assert (found["time_to_aiding_s"], found["aiding_share"], found["aiding_losses"]) == (None, 0.0, 0)


def test_reference_that_nothing_can_be_compared_with_gives_no_error(vehicle: Vehicle) -> None:
    assert isinstance(vehicle.ahrs, Ekf3Ahrs)
    truth = Trajectory(np.array([0, 1]), np.zeros((2, 3)), np.ones((2, 4)))
    found = judged(vehicle, truth=truth)
    assert (found["ate_m"], found["ate_poses"]) == (None, 0)
