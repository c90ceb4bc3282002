# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Preintegration over a second of recorded flight, against the flight's ground truth (EuRoC V1_02)."""

import os
from pathlib import Path

import numpy as np
import pytest

from tests.places import ROOT
from viso.companion.vio.config import ImuNoise
from viso.companion.vio.frames import GRAVITY_MSS
from viso.companion.vio.imu import ImuBuffer, steps_of
from viso.companion.vio.preintegration import preintegrate
from viso.companion.vio.types import ImuBias, ImuSample, ImuWindow
from viso.geometry.rotation import Array, rotation_from_quat_wxyz, so3_log

FOLDER = Path(os.environ.get("VISO_DATA", ROOT.parent / "shared" / "data")) / "euroc_v102_imu"
SECOND_NS = 1_000_000_000
GRAVITY = np.array([0, 0, -GRAVITY_MSS])

pytestmark = [pytest.mark.slow, pytest.mark.skipif(not FOLDER.is_dir(), reason="needs the data set euroc_v102_imu")]


def table(name: str) -> tuple[list[int], Array]:
    """Return the stamps and the other columns; a stamp has more digits than a double."""
    lines = (FOLDER / name).read_text().splitlines()[1:]
    cells = [line.split(",") for line in lines]
    return [int(row[0]) for row in cells], np.array([row[1:] for row in cells], dtype=np.float64)


def relative_errors(every: int, bias_known: bool = True) -> Array:
    """Return the errors (rotation, velocity, position) [N, 9] of windows of a second, each divided by its sigma.

    Args:
        every: how many ground-truth states (25 ms) apart windows start.
        bias_known: whether the bias of the ground truth is taken off.
    """
    imu_ns, imu = table("imu0.csv")
    buffer = ImuBuffer(capacity=len(imu_ns))
    for t_ns, row in zip(imu_ns, imu, strict=True):
        buffer.add(ImuSample(t_ns, row[3:6], row[:3]))
    truth_ns, truth = table("gt0.csv")
    errors = []
    for first in range(0, len(truth_ns), every):
        last = truth_ns.index(truth_ns[first] + SECOND_NS)
        if truth_ns[last] > imu_ns[-1]:
            break
        window = buffer.window(truth_ns[first], truth_ns[last])
        errors.append(relative_error(window, truth[first], truth[last], bias_known))
    return np.array(errors)


def relative_error(window: ImuWindow, start: Array, end: Array, bias_known: bool) -> Array:
    bias = ImuBias(start[13:16], start[10:13]) if bias_known else ImuBias.zero()
    delta = preintegrate(steps_of(window), ImuNoise(), bias)
    to_body = rotation_from_quat_wxyz(start[3:7]).T
    turned = to_body @ rotation_from_quat_wxyz(end[3:7])
    gained = to_body @ (end[7:10] - start[7:10] - GRAVITY * delta.dt_s)
    moved = to_body @ (end[:3] - start[:3] - start[7:10] * delta.dt_s - GRAVITY * delta.dt_s**2 / 2)
    error = np.concatenate([so3_log(delta.dR.T @ turned), gained - delta.dv, moved - delta.dp])
    relative: Array = error / np.sqrt(delta.cov.diagonal())
    return relative


def test_errors_are_within_three_sigma() -> None:
    errors = np.abs(relative_errors(every=20))
    assert len(errors) > 70
    assert (errors < 3).mean() >= 0.95


def test_errors_leave_three_sigma_when_the_bias_is_not_known() -> None:
    assert (np.abs(relative_errors(every=40, bias_known=False)) < 3).mean() < 0.5
