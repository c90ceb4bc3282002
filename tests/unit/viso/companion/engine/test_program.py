# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Engines in Python that are programs."""

import contextlib
import shlex
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.unit.viso.companion.vio.strategy_rig import make_calibration, make_warm_start
from viso.companion.engine.child import EngineFailure
from viso.companion.engine.protocol import Capability, Status
from viso.companion.engine.session import EngineSession
from viso.companion.vio.config import EngineConfig, Scalar, VioConfig

PROGRAM = '''
import numpy as np
from viso.companion.engine import Capability, EngineProgram, run

class Mean(EngineProgram):
    """Its x is the mean of the picture, its y the sum of the samples' stamps, its z the height."""
    name = "mean"
    capabilities = Capability.STARTS_AT_REST | Capability.TAKES_HEIGHT

    def set_up(self, setup, options):
        print("prints", setup.width, options)
        self.place = np.zeros(3)
        if "refuse" in options:
            raise ValueError("refused")

    def reset(self, start):
        self.place = np.zeros(3) if start is None else start.world_T_body.reshape(4, 4)[:3, 3].copy()

    def add_imu(self, t_ns, accel, gyro):
        self.place[1] += t_ns

    def add_height(self, t_ns, height_m, sigma_m):
        self.place[2] = height_m

    def add_image(self, t_ns, pixels, image_id):
        self.log(f"image {image_id}", 10)
        if image_id == 1:
            return None
        self.update_keyframe(image_id, np.eye(4), is_loop_closure=True)
        self.place[0] += pixels.mean()
        pose = np.eye(4)
        pose[:3, 3] = self.place
        return {"world_T_body": pose, "inliers": 40, "is_keyframe": image_id % 2 == 0}

raise SystemExit(run(Mean()))
'''
AMPLE = EngineConfig(start_timeout_s=60.0, frame_timeout_s=60.0)


class Mean:
    """The program in a session, and the lines that it lets be logged."""

    def __init__(self, folder: Path, **native: Scalar) -> None:
        file = folder / "mean.py"
        file.write_text(PROGRAM)
        self.lines = list[tuple[int | None, str]]()
        command = shlex.join((sys.executable, str(file)))
        config = VioConfig(engine=AMPLE, native=native)
        self.session = EngineSession(command, make_calibration(), config, lambda *line: self.lines.append(line))


@pytest.fixture(scope="module")
def mean(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Mean]:
    """Yield a program that has worked on three images."""
    mean = Mean(tmp_path_factory.mktemp("mean"), colour="red")
    with contextlib.closing(mean.session):
        yield mean


def test_program_speaks_the_protocol(mean: Mean) -> None:
    session = mean.session
    assert (session.name, session.shares) == ("mean", True)
    assert session.hello.capabilities == Capability.STARTS_AT_REST | Capability.TAKES_HEIGHT
    grey = np.full((48, 64), 9, np.uint8)
    assert session.add_image(1, grey)[1].status == Status.INITIALISING
    session.reset(make_warm_start())
    for t_ns in (2, 3):
        session.add_imu(t_ns, np.zeros(3), np.zeros(3))
    session.add_height(3, 40.0, 0.3)
    (update,), estimate = session.add_image(3, grey)
    start = make_warm_start().body_T_world.inverse().t
    assert estimate.world_T_body.reshape(4, 4)[:3, 3] == pytest.approx([start[0] + 9, start[1] + 5, 40.0])
    assert (estimate.status, estimate.image_id, estimate.keyframe_id) == (Status.TRACKING, 2, 2)
    assert (estimate.is_keyframe, estimate.inliers, estimate.innovation_ratio) == (1, 40, 1.0)
    assert (update.keyframe_id, update.is_loop_closure) == (2, 1)
    estimates = [session.add_image(t_ns, grey)[1] for t_ns in (4, 5, 6)]
    assert [(one.keyframe_id, one.is_keyframe) for one in estimates] == [(2, 0), (2, 1), (4, 0)]
    told = [(None, "prints 64 {'colour': 'red'}"), *((10, f"image {number}") for number in range(1, 6))]
    assert sorted(mean.lines, key=str) == sorted(told, key=str)


@pytest.mark.slow
def test_exception_is_told(tmp_path: Path) -> None:
    with pytest.raises(EngineFailure, match=r"^ValueError: refused$") as caught:
        Mean(tmp_path, refuse="yes")
    assert caught.value.kind == "failures"
