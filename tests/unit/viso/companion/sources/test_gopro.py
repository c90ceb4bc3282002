# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A GoPro's telemetry in the axes and the time of the rest."""

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.places import SHARED
from tests.unit.viso.companion.sources.gopro_maker import (
    ACCEL_HZ,
    GYRO_HZ,
    camera,
    item,
    movie,
    numbers,
    seconds_of_flight,
    sensor,
    stream,
)
from viso.companion.sources.base import SourceError
from viso.companion.sources.gopro import Telemetry, has_telemetry, read_telemetry
from viso.companion.sources.karma import DELAY_S

KARMA = SHARED / "karma_flight" / "karma.mp4"
needs_karma = pytest.mark.skipif(not KARMA.exists(), reason="karma_flight is not there")


def read(tmp_path: Path, payloads: list[bytes]) -> Telemetry:
    path = tmp_path / "film.mp4"
    path.write_bytes(movie(payloads))
    return read_telemetry(path)


def attitude(*rows: tuple[int, float, float, float]) -> bytes:
    about = {"type": item("TYPE", "c", 1, b"Lfff"), "scal": numbers("SCAL", "l", "i", [1000], [1], [1], [1])}
    return stream(numbers("ATTD", "?", "Ifff", *rows), **about)


def place(*rows: tuple[float, ...]) -> bytes:
    about = {"type": item("TYPE", "c", 1, b"Lffffff"), "scal": numbers("SCAL", "l", "i", [1000], *[[1]] * 6)}
    return stream(numbers("LNED", "?", "Iffffff", *rows), **about)


def test_columns_of_a_hero5_are_up_left_and_back(tmp_path: Path) -> None:
    sample = read(tmp_path, seconds_of_flight(2, accel=(981, 20, -30), gyro=(3, 2, 1))).samples[50]
    np.testing.assert_allclose(sample.accel, [0.3, 0.2, 9.81])
    np.testing.assert_allclose(sample.gyro, [-0.01, 0.02, 0.03])


def test_axes_that_are_told_count(tmp_path: Path) -> None:
    sample = read(tmp_path, seconds_of_flight(2, accel=(30, -20, 981), gyro=(-1, -2, 3), axes="yxZ")).samples[50]
    np.testing.assert_allclose(sample.accel, [0.3, 0.2, 9.81])
    np.testing.assert_allclose(sample.gyro, [-0.01, 0.02, 0.03])


def test_samples_come_at_the_rate_of_the_camera_s_clock(tmp_path: Path) -> None:
    samples = read(tmp_path, seconds_of_flight(3, accel=(981, 0, 0), gyro=(0, 0, 0))).samples
    times = np.array([sample.t_ns for sample in samples])
    np.testing.assert_allclose(np.diff(times), 1e9 / ACCEL_HZ, atol=1)
    # By its own clock, a payload takes 1 s, in the video 1.001 s: they agree in the middle.
    assert times[0] == pytest.approx(1e6, abs=6e6)


def test_without_a_clock_the_video_s_counts(tmp_path: Path) -> None:
    payloads = [camera(sensor("ACCL", [(1, 0, 0)] * 100, 1), sensor("GYRO", [(0, 0, 0)] * 100, 1)) for _ in range(3)]
    samples = read(tmp_path, payloads).samples
    np.testing.assert_allclose(np.diff([sample.t_ns for sample in samples]), 1.001e7, atol=1)


def test_one_payload_is_enough(tmp_path: Path) -> None:
    samples = read(tmp_path, seconds_of_flight(1, accel=(981, 0, 0), gyro=(0, 0, 0))).samples
    np.testing.assert_allclose(np.diff([sample.t_ns for sample in samples]), 1.001e9 / ACCEL_HZ, atol=1)


def test_rates_are_means_around_the_accelerometer_s_samples(tmp_path: Path) -> None:
    swing = [(round(1e4 * math.sin(2 * math.pi * 3 * index / GYRO_HZ)), 0, 0) for index in range(GYRO_HZ)]
    payload = camera(sensor("ACCL", [(0, 0, 0)] * ACCEL_HZ, 1), sensor("GYRO", swing, 10_000))
    for sample in read(tmp_path, [payload]).samples:
        expected = math.sin(2 * math.pi * 3 * sample.t_ns * 1e-9 / 1.001)
        assert sample.gyro[2] == pytest.approx(expected, abs=2e-3)


def test_drone_that_tells_nothing_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, seconds_of_flight(1, (1, 0, 0), (0, 0, 0))).drone is None


def test_drone_is_placed_in_the_time_of_the_video(tmp_path: Path) -> None:
    payloads = seconds_of_flight(2, (1, 0, 0), (0, 0, 0))
    for number, boot_ms in enumerate((60_300, 61_301)):
        times = (boot_ms, boot_ms + 400)
        told = (place(*((t, 1, 2, -3, 4, 5, -6) for t in times)), attitude(*((t, 0.1, 0.2, 0.3) for t in times)))
        payloads[number] += camera(*told)
    drone = read(tmp_path, payloads).drone
    assert drone is not None
    # All came between the start of their payload and its end: 60.3 - 0 and 60.7 - 1.001 are the limits.
    np.testing.assert_allclose(drone.t_s + 0.5 * (60.3 + 59.699) + DELAY_S, [60.3, 60.7, 61.301, 61.701])
    np.testing.assert_allclose(drone.position_w[0], [2, 1, 3])
    np.testing.assert_allclose(drone.velocity_w[0], [5, 4, 6])


@pytest.mark.parametrize(
    ("payloads", "complaint"),
    [
        ([camera(sensor("GYRO", [(0, 0, 0)] * 9, 1))], "no ACCL"),
        ([camera(sensor("ACCL", [(0, 0, 0)] * 9, 1))], "no GYRO"),
        ([camera(sensor("ACCL", [(0, 0, 0)], 1), sensor("GYRO", [(0, 0, 0)] * 9, 1))], "ACCL: one sample"),
        (seconds_of_flight(1, (0, 0, 0), (0, 0, 0), axes="XXZ"), "axes 'XXZ'"),
        ([camera(stream(numbers("ACCL", "s", "hh", *[(0, 0)] * 9)))], "ACCL: columns missing, or not finite"),
        ([camera(stream(numbers("ACCL", "f", "fff", (math.nan, 0, 0))))], "ACCL: columns missing, or not finite"),
        (seconds_of_flight(2, (0, 0, 0), (0, 0, 0))[::-1], "ACCL: times do not increase"),
        ([b"DEVC"], "no ACCL"),
    ],
)
def test_telemetry_that_is_none_is_told(tmp_path: Path, payloads: list[bytes], complaint: str) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(movie(payloads))
    with pytest.raises(SourceError) as caught:
        read_telemetry(path)
    assert str(caught.value) == f"{path}: not the telemetry of a GoPro, or a damaged one: {complaint}"


def test_file_with_telemetry_is_told_from_others(tmp_path: Path) -> None:
    film, other = tmp_path / "film.mp4", tmp_path / "other.mp4"
    film.write_bytes(movie([b"whatever"]))
    other.write_bytes(movie([b"whatever"], b"mp4v"))
    assert [has_telemetry(path) for path in (film, other, tmp_path / "none.mp4")] == [True, False, False]


SOUND = movie(
    [
        camera(
            sensor("ACCL", [(9, 1, 2)] * 6, 1, total=6 * number + 6, tick_ms=1000 * number),
            sensor("GYRO", [(1, 2, 3)] * 12, 100, total=12 * number + 12, tick_ms=1000 * number),
            place((60_000 + 1001 * number, 1, 2, 3, 4, 5, 6)),
            attitude((60_000 + 1001 * number, 0.1, 0.2, 0.3)),
        )
        for number in range(2)
    ]
)


@pytest.mark.slow
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, len(SOUND) - 1), st.integers(0, 255)), min_size=1, max_size=4))
def test_whatever_a_film_holds_nothing_else_is_raised(tmp_path: Path, changes: list[tuple[int, int]]) -> None:
    film = bytearray(SOUND)
    for position, value in changes:
        film[position] = value
    path = tmp_path / "film.mp4"
    path.write_bytes(bytes(film))
    try:
        telemetry = read_telemetry(path)
    except SourceError:
        return
    times = [sample.t_ns for sample in telemetry.samples]
    assert times == sorted(times)


@pytest.fixture(scope="module")
def karma() -> Telemetry:
    return read_telemetry(KARMA)


@needs_karma
def test_karma_s_camera_feels_gravity_and_speeds_up(karma: Telemetry) -> None:
    telemetry = karma
    accel = np.array([sample.accel for sample in telemetry.samples])
    times = np.array([sample.t_ns for sample in telemetry.samples]) * 1e-9
    assert len(telemetry.samples) == 2396
    assert float(np.median(np.diff(times))) == pytest.approx(1 / 198.77, rel=1e-3)
    assert accel[:, 2].mean() == pytest.approx(9.7, abs=0.1)
    assert accel[times < 1, 0].mean() > 2.0  # it takes off forwards


@needs_karma
def test_karma_s_drone_agrees_with_its_camera(karma: Telemetry) -> None:
    telemetry = karma
    drone = telemetry.drone
    assert drone is not None
    assert drone.t_s[[0, -1]].tolist() == pytest.approx([0.03, 11.63], abs=0.01)
    start = drone.start_at(float(drone.t_s[0]), telemetry.samples)
    ahead, left, up = start.velocity_b.tolist()
    assert ahead > 1.0
    assert max(abs(left), abs(up)) < 0.3
    assert start.bias.norm() < 1.0
