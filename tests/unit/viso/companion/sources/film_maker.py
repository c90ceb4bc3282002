# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes small videos and what belongs to them."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT = 96, 64
CALIBRATION = f"""
camera_id = "small"
unit = "1"
width = {WIDTH}
height = {HEIGHT}
fx = 80.0
fy = 80.0
cx = 47.5
cy = 31.5
mounting = "forward"
"""


def write_film(path: Path, count: int = 12, fps: float = 10.0, size: tuple[int, int] = (WIDTH, HEIGHT)) -> Path:
    """Write a video of something that stands still, with a little noise."""
    rng = np.random.default_rng(3)
    scene = cv2.GaussianBlur(rng.integers(0, 256, (size[1], size[0]), np.uint8), (0, 0), 1.5)
    scene = cv2.normalize(scene, scene, 0, 255, cv2.NORM_MINMAX)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), fps, size)
    for _ in range(count):
        writer.write(cv2.cvtColor(scene, cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def write_inertial_csv(path: Path, seconds: float, gravity: Sequence[float] = (0.0, 0.0, 9.81)) -> Path:
    """Write what an IMU at rest measures, 200 times per second."""
    lines = ["t_s,gx,gy,gz,ax,ay,az"]
    lines += [f"{index / 200},0,0,0,{','.join(map(str, gravity))}" for index in range(round(200 * seconds))]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_calibration(path: Path) -> Path:
    """Write the calibration of the camera that films these."""
    path.write_text(CALIBRATION)
    return path
