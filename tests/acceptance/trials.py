# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What acceptance tests of strategies share: flights over generated ground and recorded ones, each flown only once."""

import dataclasses
import functools
import os
from pathlib import Path

import numpy as np
import pytest

from tests.acceptance.trial import Trial, disturbed_start, run_trial
from tests.places import ROOT
from viso.companion.odometry.composer import OdometryComposer
from viso.companion.sources.euroc import EurocRecording, load_euroc
from viso.companion.vio.config import AglSource, LocalAlignment, Scene, VioConfig
from viso.companion.vio.types import VioState
from viso.companion.world.flight import SyntheticFlight
from viso.companion.world.ground import generate_texture
from viso.companion.world.motion import nadir_survey
from viso.companion.world.texture import GroundTexture
from viso.geometry.rotation import Array

DATA = Path(os.environ.get("VISO_DATA", ROOT.parent / "shared" / "data"))
NADIR = VioConfig(scene=Scene.PLANAR, agl_source=AglSource.RANGEFINDER)

CLIP_SEEDS = range(3)
LARGE_ERROR_M = 0.15
STILL_S = 3.5


def data_folder(name: str) -> Path:
    """Return the folder of a data set; skip the test where it is absent."""
    folder = DATA / name
    if not folder.is_dir():
        pytest.skip(f"needs the data set {name}")
    return folder


@functools.cache
def ground() -> GroundTexture:
    return generate_texture()


def fly_nadir_again(
    strategy: str,
    seed: int,
    *,
    speed_m_s: float = 8.0,
    height_m: float = 40.0,
    height_scale: float = 1.0,
    duration_s: float = 60.0,
) -> Trial:
    """Fly a survey, the camera looking down: 640x480 at 3.33 Hz, the height known to 0.3 m."""
    flight = SyntheticFlight(
        seed=seed,
        trajectory=nadir_survey(speed_m_s, height_m, seed=seed),
        texture=ground(),
        height_scale=height_scale,
        duration_s=duration_s,
    )
    config = dataclasses.replace(NADIR, strategy=strategy)
    return run_trial(flight, config, flight.warm_start(), truth=flight.truth)


fly_nadir = functools.cache(fly_nadir_again)


def composed(trial: Trial, scale_sigma: float) -> Trial:
    """Return a trial whose poses are composed with another sigma of the scale."""
    composer = OdometryComposer(LocalAlignment.NORTH, world_is_north=True, agl_scale_sigma=scale_sigma)
    frames = (dataclasses.replace(frame, local=composer.compose_alone(frame.result.output)) for frame in trial.frames)
    return Trial(tuple(frames))


@functools.cache
def clip() -> EurocRecording:
    """Return EuRoC MH_01 from 5 to 24 s."""
    return load_euroc(data_folder("euroc_mh01_clip"))


def fly_clip_again(strategy: str, seed: int, images: int | None = None) -> Trial:
    """Follow the clip, or its first images, from a state that is 1 degree and 0.2 m/s off."""
    part = dataclasses.replace(clip(), images=clip().images[:images])
    return run_trial(part, VioConfig(strategy=strategy), disturbed_start(part, seed), truth=part.truth)


fly_clip = functools.cache(fly_clip_again)


def clip_errors_m(strategy: str) -> list[float]:
    """Return the error of the trajectory on the clip, from each start."""
    return [fly_clip(strategy, seed).absolute_error().rmse_m for seed in CLIP_SEEDS]


def claims_to_track(trial: Trial) -> bool:
    """Return whether a strategy never said that something was wrong."""
    return set(trial.states()) <= {VioState.INIT, VioState.TRACKING}


def still_end(trial: Trial) -> tuple[float, Array]:
    """Return the largest drift in m, and the speeds [N] in m/s, at the end of a trial whose body then stands still."""
    outputs = [(frame.result.t_ns, frame.result.output) for frame in trial.frames]
    end_ns = outputs[-1][0]
    still = [output for t_ns, output in outputs if output is not None and t_ns > end_ns - STILL_S * 1e9]
    places = np.array([output.world_T_body.t for output in still])
    speeds = np.array([np.linalg.norm(output.velocity_b) for output in still])
    return float(np.linalg.norm(places - places[0], axis=1).max()), speeds


def trace_of(trial: Trial) -> bytes:
    """Return all that a strategy said about its motion, as bytes."""
    outputs = [frame.result.output for frame in trial.frames]
    return b"".join(
        output.world_T_body.matrix().tobytes() + output.pose_covariance_6x6.tobytes()
        for output in outputs
        if output is not None
    )
