# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The smoother as a strategy: over synthetic ground, and when it fails."""

import functools
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("gtsam")

from tests.acceptance.trial import Trial, TrialFrame, run_trial
from viso.companion.smoother.lag_smoother import LagSmoother, SmootherError
from viso.companion.strategies.fixed_lag import MIN_NODE_INTERVAL_NS
from viso.companion.vio.config import VioConfig
from viso.companion.vio.errors import StrategyNotAvailableError
from viso.companion.vio.health import NON_FINITE, SCALE_UNOBSERVED
from viso.companion.vio.types import ImuSample, SensorEvent, VioState
from viso.companion.world.flight import SyntheticFlight, nadir_calibration
from viso.companion.world.ground import generate_texture
from viso.companion.world.texture import GroundTexture


@functools.cache
def ground() -> GroundTexture:
    return generate_texture(size_px=1024)


def fly(
    duration_s: float, *, config: dict[str, Any] | None = None, flight_class: Any = SyntheticFlight, **changed: Any
) -> Trial:
    """Fly over flat ground, with a range finder and, unless told otherwise, a small camera.

    The smoother works only where the scene is not configured as a plane. Otherwise the filter takes its place.
    """
    settings: dict[str, Any] = {
        "strategy": "fixed_lag",
        "scene": "planar",
        "agl_source": "rangefinder",
        "max_features": 100,
    }
    settings |= config or {}
    camera: dict[str, Any] = {"calibration": nadir_calibration(320, 240, 250.0)}
    flight = flight_class(duration_s=duration_s, texture=ground(), **(camera | changed))
    return run_trial(flight, VioConfig(**settings), flight.warm_start(), truth=flight.truth)


@functools.cache
def plain_flight() -> Trial:
    return fly(5.0)


def states(trial: Trial) -> list[VioState]:
    return [frame.result.state for frame in trial.frames]


def positions(trial: Trial) -> list[list[float]]:
    return [frame.result.output.world_T_body.t.tolist() for frame in trial.frames if frame.result.output is not None]


def test_ground_below_is_tracked() -> None:
    assert set(states(plain_flight())[3:]) == {VioState.TRACKING}


def test_place_is_known_to_two_percent_of_a_short_path() -> None:
    assert plain_flight().drift_share() < 0.02


def test_velocity_gets_better_than_at_the_start() -> None:
    flight = SyntheticFlight(texture=ground())
    outputs = [(frame.result.t_ns, frame.result.output) for frame in plain_flight().frames]
    speeds = [(t_ns, one.world_T_body.R.dot(one.velocity_b)) for t_ns, one in outputs if one is not None]
    errors = np.array([np.linalg.norm(velocity_w - flight.truth_velocity_w(t_ns)) for t_ns, velocity_w in speeds])
    assert errors[-5:].max() < 0.5 * errors[0]


def test_relative_poses_are_as_uncertain_as_they_say() -> None:
    assert 0.2 < plain_flight().relative_nees() < 3


def test_innovations_are_about_as_expected() -> None:
    assert 0.2 < plain_flight().frames[-1].result.innovation_ratio < 2


@pytest.mark.slow
def test_same_flight_same_poses() -> None:
    again = positions(fly(2.5))
    assert again == positions(plain_flight())[: len(again)]


@pytest.mark.slow
def test_frames_between_nodes_have_outputs_too() -> None:
    trial = fly(2.0, frame_rate_hz=15.0)
    outputs = [frame.result.output for frame in trial.frames]
    assert all(output is not None for output in outputs[2:])
    keyframes_ns = [frame.result.t_ns for frame in trial.frames if is_keyframe(frame)]
    assert min(np.diff(keyframes_ns)) >= MIN_NODE_INTERVAL_NS
    assert np.linalg.norm(trial.position_errors(), axis=1).max() < 0.5


def is_keyframe(frame: TrialFrame) -> bool:
    return frame.result.output is not None and frame.result.output.is_keyframe


@pytest.mark.slow
def test_too_few_landmarks_are_not_tracking() -> None:
    trial = fly(1.5, config={"scene": "general"}, frame_rate_hz=10.0)  # landmarks want three nodes, outputs two frames
    healths = [frame.result for frame in trial.frames]
    assert (healths[2].state, healths[2].reason) == (VioState.DEGRADED, SCALE_UNOBSERVED)
    assert healths[-1].state is VioState.TRACKING


@pytest.mark.slow
def test_covered_lens_is_survived() -> None:
    trial = fly(5.5, covered_s=((2.5, 3.4),))
    covered = [frame for frame in trial.frames if 2.5 < frame.result.t_ns * 1e-9 < 3.4]
    assert [frame.result.consecutive_lost for frame in covered] == [1, 2, 3]
    assert states(trial)[-1] is VioState.TRACKING
    assert np.linalg.norm(trial.position_errors()[-1]) < 1.0


def failing(times: range) -> Any:
    """Return what solves as ever but for some of the calls."""
    solve, count = LagSmoother.solve, iter(range(10_000))

    def sometimes(self: LagSmoother, *args: Any, **named: Any) -> None:
        if next(count) in times:
            raise SmootherError("indeterminate")
        solve(self, *args, **named)

    return sometimes


@pytest.mark.slow
def test_unsolvable_frame_is_a_lost_one_and_the_next_a_keyframe(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LagSmoother, "solve", failing(range(8, 9)))
    trial = fly(4.5, config={"scene": "general"})
    before, lost, after = trial.frames[7:10]
    assert before.result.state is VioState.TRACKING
    assert (lost.result.reason, lost.result.consecutive_lost) == (NON_FINITE, 1)
    assert after.result.consecutive_lost == 0
    assert (is_keyframe(lost), is_keyframe(after)) == (False, True)
    assert states(trial)[-1] is VioState.TRACKING
    assert np.linalg.norm(trial.position_errors(), axis=1).max() < 1.0


@pytest.mark.slow
def test_smoother_that_always_fails_leaves_inertial_data(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(LagSmoother, "solve", failing(range(5, 10_000)))
    trial = fly(3.0, config={"scene": "general", "lost_frames_fatal": 4})
    assert states(trial)[-1] is VioState.LOST
    assert trial.frames[-1].result.output is None


class GappyFlight(SyntheticFlight):
    """A flight whose inertial data are missing for a while."""

    def events(self) -> Iterator[SensorEvent]:
        return (one for one in super().events() if not (isinstance(one, ImuSample) and 2.0e9 < one.t_ns < 2.5e9))


@pytest.mark.slow
def test_missing_inertial_data_are_survived() -> None:
    trial = fly(5.0, flight_class=GappyFlight)
    assert VioState.DEGRADED in states(trial)
    assert states(trial)[-1] is VioState.TRACKING
    assert np.linalg.norm(trial.position_errors()[-1]) < 2.0


def test_missing_gtsam_tells_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("lag_smoother", "belief", "landmarks", "estimator"):
        monkeypatch.delitem(sys.modules, f"viso.companion.smoother.{module}", raising=False)
    monkeypatch.delitem(sys.modules, "viso.companion.strategies.fixed_lag", raising=False)
    monkeypatch.setitem(sys.modules, "gtsam", None)
    with pytest.raises(StrategyNotAvailableError, match=r"^[^\n]*pip install 'ardupilot-viso\[gtsam\]'$"):
        fly(1.0)
