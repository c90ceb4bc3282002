# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Standing still: what counts as it, at any rate of pictures, and what does not."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.companion.msckf.point_world import sighting_of
from viso.companion.klt.front_end import Sighting
from viso.companion.klt.outliers import Model
from viso.companion.msckf.stillness import Stillness, level_rotation
from viso.companion.vio.types import ImuSample, ImuWindow
from viso.geometry.rotation import Array

FOCAL = 500.0
POINTS = np.random.default_rng(0).uniform(-0.4, 0.4, (50, 2))
GRAVITY = np.array([0.0, 0.0, 9.8])
S = 1_000_000_000
RATES_HZ = [3, 10, 30, 60]


class Rig:
    """Frames at a rate, and the inertial data between them.

    Attributes:
        gyro_std, accel_std: of noise.
        pixel_std: of the points' places, in px.
        speed_px_s: by which the picture moves.
    """

    def __init__(self, rate_hz: float = 10) -> None:
        self.stillness = Stillness(FOCAL)
        self.gyro_std, self.accel_std, self.pixel_std, self.speed_px_s = 0.003, 0.03, 0.05, 0.0
        self._period_ns = round(S / rate_hz)
        self._rng = np.random.default_rng(1)
        self._now_ns, self._moved_px = 0, 0.0

    def frames(self, duration_s: float, model: Model | None = Model.ROTATION) -> Iterator[float]:
        """Let time pass; yield it, in s since this began, after each frame."""
        begin_ns = self._now_ns
        while self._now_ns - begin_ns < duration_s * S:
            last_ns, self._now_ns = self._now_ns, self._now_ns + self._period_ns
            self._moved_px += self.speed_px_s * self._period_ns / S
            self.stillness.note(self._window(last_ns), self._sighting(model))
            yield (self._now_ns - begin_ns) / S

    def run(self, duration_s: float, model: Model | None = Model.ROTATION) -> None:
        for _ in self.frames(duration_s, model):
            pass

    def _window(self, last_ns: int) -> ImuWindow:
        step_ns = 5_000_000
        times = range(last_ns - last_ns % step_ns, self._now_ns + step_ns, step_ns)
        samples = [
            ImuSample(
                t_ns, GRAVITY + self._rng.normal(0, self.accel_std, 3), self._rng.normal([0.02, 0, 0], self.gyro_std)
            )
            for t_ns in times
        ]
        return ImuWindow(last_ns, self._now_ns, tuple(samples))

    def _sighting(self, model: Model | None) -> Sighting:
        noise = self._rng.normal(0, self.pixel_std, POINTS.shape)
        return sighting_of(range(len(POINTS)), POINTS + (noise + np.array([self._moved_px, 0.0])) / FOCAL, model)


def test_nothing_is_known_at_first() -> None:
    assert not Stillness(FOCAL).is_still()
    assert not Stillness(FOCAL).is_start()


@pytest.mark.parametrize("rate_hz", RATES_HZ)
def test_a_quarter_of_a_second_is_still_and_half_a_second_a_start(rate_hz: float) -> None:
    rig, still_s, start_s = Rig(rate_hz), [], []
    for at_s in rig.frames(1.5):
        still_s += [at_s] * rig.stillness.is_still()
        start_s += [at_s] * rig.stillness.is_start()
    period_s = 1 / rate_hz
    assert 0.25 <= still_s[0] - period_s <= 0.25 + period_s  # the first picture has nothing to compare with
    assert 0.5 <= start_s[0] - period_s <= 0.5 + period_s
    assert still_s[-1] == start_s[-1] == at_s


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("speed_px_s", [4.0, 30.0])
def test_slow_motion_is_no_rest_however_fast_the_pictures_come(rate_hz: float, speed_px_s: float) -> None:
    rig = Rig(rate_hz)
    rig.speed_px_s = speed_px_s
    assert not any(rig.stillness.is_still() for _ in rig.frames(3.0))


def test_motion_ends_the_rest_at_once() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.speed_px_s = 20.0
    rig.run(0.1)
    assert not rig.stillness.is_still()


def test_rest_begins_again_after_motion() -> None:
    rig = Rig()
    rig.speed_px_s = 20.0
    rig.run(1.0)
    rig.speed_px_s = 0.0
    rig.run(0.2)
    assert not rig.stillness.is_still()
    rig.run(0.4)
    assert rig.stillness.is_still()


@pytest.mark.parametrize(("gyro_std", "accel_std"), [(0.04, 0.03), (0.003, 0.4)])
def test_shaken_body_does_not_rest(gyro_std: float, accel_std: float) -> None:
    rig = Rig()
    rig.gyro_std, rig.accel_std = gyro_std, accel_std
    assert not any(rig.stillness.is_still() for _ in rig.frames(2.0))


def test_long_rest_goes_on() -> None:
    rig = Rig()
    rig.run(0.5)
    assert all(rig.stillness.is_still() for _ in rig.frames(10.0))


def test_bias_of_the_gyro_is_no_motion() -> None:
    """It would be one if the gyro's rotation were taken out of the pictures."""
    rig = Rig(3)
    rig.run(2.0)
    assert rig.stillness.is_still()
    gyro, accel = rig.stillness.means()
    assert gyro == pytest.approx([0.02, 0, 0], abs=0.002)
    assert accel == pytest.approx(GRAVITY, abs=0.02)


def test_picture_without_a_model_ends_the_rest() -> None:
    rig = Rig()
    rig.run(1.0)
    rig.run(0.1, model=None)
    assert not rig.stillness.is_still()


def test_other_points_end_the_rest() -> None:
    rig = Rig()
    rig.run(1.0)
    samples = tuple(ImuSample(t_ns, GRAVITY, np.zeros(3)) for t_ns in range(S, S + 101_000_000, 5_000_000))
    rig.stillness.note(ImuWindow(S, S + 100_000_000, samples), sighting_of(range(1000, 1050), POINTS))
    assert not rig.stillness.is_still()


def test_too_few_inertial_data_are_no_rest() -> None:
    stillness = Stillness(FOCAL)
    for t_ns in range(0, 3 * S, S // 10):
        samples = tuple(ImuSample(at_ns, GRAVITY, np.zeros(3)) for at_ns in (t_ns - S // 20, t_ns))
        stillness.note(ImuWindow(t_ns - S // 10, t_ns, samples), sighting_of(range(50), POINTS))
        assert not stillness.is_still()


def test_inertial_data_of_long_ago_are_forgotten() -> None:
    rig = Rig()
    rig.run(5.0)
    assert len(rig.stillness._samples) <= 101


DIRECTIONS = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda vector: float(np.linalg.norm(vector)) > 0.1)


@given(DIRECTIONS)
def test_level_attitude_turns_the_felt_force_up(accel: Array) -> None:
    rotation = level_rotation(9.8 * accel)
    assert rotation @ accel == pytest.approx([0, 0, np.linalg.norm(accel)], abs=1e-9)
    assert np.allclose(rotation @ rotation.T, np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1)


@pytest.mark.parametrize("accel", [(0, 0, 1), (0.3, -0.2, 0.9), (0.9, 0.1, 0.2)])
def test_level_attitude_has_no_yaw(accel: tuple[float, float, float]) -> None:
    ahead = level_rotation(np.array(accel, float))[:, 0]
    assert ahead[0] > 0
    assert ahead[1] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_body_on_its_tail_or_nose_has_an_attitude_as_well(sign: float) -> None:
    rotation = level_rotation(np.array([sign, 0.0, 0.0]))
    assert rotation @ [sign, 0, 0] == pytest.approx([0, 0, 1])
    assert np.allclose(rotation @ rotation.T, np.eye(3))
