# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the baseline must achieve on a drone's own video, thinned to the rate of a survey camera (A7)."""

import functools
from statistics import median

import pytest

from tests.acceptance.trial import Trial, run_trial
from tests.acceptance.trials import data_folder, trace_of
from viso.companion.sources.base import Recording, SourceOptions
from viso.companion.sources.kinds import open_source
from viso.companion.vio.types import VioState
from viso.companion.world.flight import DEFAULT_FRAME_RATE_HZ

pytestmark = pytest.mark.slow


def fly_again() -> Trial:
    film = data_folder("karma_flight") / "karma.mp4"
    source = open_source(SourceOptions(str(film), fps=DEFAULT_FRAME_RATE_HZ))
    assert isinstance(source, Recording)
    assert (source.calibration.width, source.calibration.height) == (854, 480)
    assert source.config.max_features == 200
    assert source.config.strategy == "klt_ransac"
    return run_trial(source, source.config, source.start)


fly = functools.cache(fly_again)


def test_it_begins_with_two_frames_and_is_never_lost() -> None:
    states = [frame.result.state for frame in fly().frames]
    assert len(states) > 30
    assert states[:2] == [VioState.INIT] * 2
    assert set(states[2:]) <= {VioState.TRACKING, VioState.DEGRADED}


def test_three_quarters_of_the_points_are_found_again() -> None:
    outputs = [frame.result.output for frame in fly().frames]
    assert median(output.feature_quality.tracked for output in outputs if output is not None) >= 150


def test_it_gives_the_same_bytes_again() -> None:
    assert trace_of(fly_again()) == trace_of(fly())
