# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of hills and of a room."""

import dataclasses

import numpy as np
import pytest

pytest.importorskip("cv2")

from tests.scenery import Hills, Room
from viso.companion.vio.frames import MOUNTINGS
from viso.companion.world.flight import nadir_calibration
from viso.companion.world.renderer import PlaneRenderer, Renderer
from viso.companion.world.texture import GroundTexture
from viso.geometry.pose import SE3

CALIBRATION = dataclasses.replace(nadir_calibration(160, 120, 125.0), B_T_C=SE3(MOUNTINGS["nadir"], np.zeros(3)))
AHEAD = dataclasses.replace(CALIBRATION, B_T_C=SE3(MOUNTINGS["forward"], np.zeros(3)))
TEXTURE = GroundTexture(
    np.kron(np.random.default_rng(0).integers(60, 200, (32, 32)), np.ones((8, 8))).astype(np.uint8),
    0.5,
    np.full((64, 64), 128, np.uint8),
)


def at(*place: float) -> SE3:
    return SE3(np.eye(3), np.array(place))


def test_hills_without_height_are_a_plane() -> None:
    hills = Hills(0.0).renderer(TEXTURE, CALIBRATION, 0, 0.0).render(at(3, 4, 40), 0, 0).pixels
    plane = PlaneRenderer(TEXTURE, CALIBRATION, noise_sigma=0.0).render(at(3, 4, 40), 0, 0).pixels
    assert np.percentile(np.abs(hills.astype(int) - plane), 99) <= 1


def test_top_of_a_hill_is_seen_as_large_as_it_is_near() -> None:
    hills = Hills(8.0, seed=0)
    east, north = (grid.ravel() for grid in np.meshgrid(np.arange(-40.0, 40.0), np.arange(-40.0, 40.0)))
    ground_m = hills.ground_m(east, north)
    assert np.abs(ground_m).max() <= 8.0
    assert np.ptp(ground_m) > 6.0
    top = int(ground_m.argmax())
    place = at(east[top], north[top], 40.0)
    near = hills.renderer(TEXTURE, CALIBRATION, 0, 0.0).render(place, 0, 0).pixels[50:70, 70:90]
    level = at(east[top], north[top], 40.0 - ground_m[top])
    same = Hills(0.0).renderer(TEXTURE, CALIBRATION, 0, 0.0).render(level, 0, 0).pixels[50:70, 70:90]
    assert np.median(np.abs(near.astype(int) - same)) <= 8


@pytest.fixture(scope="module")
def room() -> Renderer:
    return Room().renderer(TEXTURE, AHEAD, 0, 0.0)


def test_room_is_seen_from_within_only(room: Renderer) -> None:
    assert room.render(at(0, 0, 1.5), 0, 0).pixels.std() > 5
    with pytest.raises(ValueError, match="not in the room"):
        room.render(at(0, 0, 5.0), 0, 0)


def test_wall_of_a_room_grows_as_the_camera_comes_nearer(room: Renderer) -> None:
    far, near = (room.render(at(4.0 - distance, 0.0, 1.5), 0, 0).pixels for distance in (2.0, 1.0))
    assert np.median(np.abs(near[40:80:2, 60:100:2].astype(int) - far[50:70, 70:90])) <= 25
