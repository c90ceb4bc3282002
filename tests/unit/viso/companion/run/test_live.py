# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An odometry in real time, by a clock that moves only while it waits, and without threads."""

import dataclasses
import itertools
import logging
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest

from mav_handlers.links.base import Link
from mav_handlers.links.pair import make_pair
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    ATTITUDE,
    COMMAND_LONG,
    DISTANCE_SENSOR,
    HEARTBEAT,
    ODOMETRY,
    RAW_IMU,
    STATUSTEXT,
    Message,
)
from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film, write_inertial_csv
from viso.companion.run import live as vio_live
from viso.companion.run.live import FrameMailbox, LiveVio
from viso.companion.run.log import VioLog
from viso.companion.sources.base import Recording, SourceError, SourceOptions
from viso.companion.sources.camera import LiveCamera
from viso.companion.sources.recordings import open_video
from viso.companion.strategies.klt_ransac import KltRansac
from viso.companion.vio.config import AglSource, VioConfig
from viso.companion.vio.runtime import VioRuntime
from viso.companion.vio.types import HeightMeasurement, ImuBias, SensorEvent, VioState, WarmStartPose
from viso.geometry.pose import SE3

ALIVE = HEARTBEAT(2, 3, 0, 0, 4, 3)
LEVEL_EAST = (0.0, 0.0, np.pi / 2, 0.0, 0.0, 0.0)
SILENT = logging.Logger("test", logging.CRITICAL)


class StepRuntime(VioRuntime):
    """Works on frames when it is told to, not in threads."""

    def __init__(self, config: VioConfig, calibration: Any, source: Any, imu: Any, **options: Any) -> None:
        super().__init__(config, calibration, source, imu, **options)
        self._frames, self._ended = source, False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._frames.close()

    def pump(self) -> None:
        """Work on what is there: all frames handed over, or one of a camera."""
        while not self._ended and not (isinstance(self._frames, FrameMailbox) and self._frames._frames.empty()):
            try:
                frame = self._frames.read()
            except OSError:
                frame = None
            if frame is None:
                self._ended = True
                return
            self.pipeline.process(frame)
            if not isinstance(self._frames, FrameMailbox):
                return

    def wait(self, timeout_s: float | None = None) -> bool:
        return self._ended


class Rig:
    """A companion on a wire, with a clock; ``arrived`` holds what came to the other end, and when in s."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, source: Recording | LiveCamera, **options: Any) -> None:
        self.now_ns = self.start_ns = 50 * 10**9
        self.arrived: list[tuple[float, Message]] = []
        self.texts: list[STATUSTEXT] = []
        self.log = VioLog(source.config)
        self.on_wait: Callable[[], None] = lambda: None
        self._link, self._vehicle = make_pair()
        self._codec = Codec(1, 1)
        self.runtimes: list[StepRuntime] = []
        monkeypatch.setattr(vio_live, "wait_readable", self._wait)
        monkeypatch.setattr(vio_live, "VioRuntime", self._runtime)
        config = options.pop("config", source.config)
        self.live = LiveVio(
            source,
            config,
            self.log,
            SILENT,
            options.pop("link", self._link),
            on_text=self.texts.append,
            now_ns=lambda: self.now_ns,
            **options,
        )

    def _runtime(self, *args: Any, **options: Any) -> StepRuntime:
        self.runtimes.append(StepRuntime(*args, **options))
        return self.runtimes[-1]

    def _wait(self, _links: Iterable[Link], timeout_s: float) -> list[Link]:
        self.runtimes[0].pump()
        self._codec.feed(self._vehicle.receive())
        while (received := self._codec.next_received()) is not None:
            assert isinstance(received, Received)
            assert received.message is not None
            self.arrived.append(((self.now_ns - self.start_ns) * 1e-9, received.message))
        self.now_ns += max(round(timeout_s * 1e9), 1000)
        self.on_wait()
        return []

    def say(self, *messages: Message) -> None:
        """Let the vehicle say something."""
        self._vehicle.send(b"".join(map(self._codec.encode, messages)))

    def counts(self) -> Counter[str]:
        """Return how many messages of which kind have arrived."""
        return Counter(type(message).__name__ for _, message in self.arrived)

    def odometry(self) -> list[tuple[float, ODOMETRY]]:
        """Return when which ODOMETRY has arrived."""
        return [(at_s, message) for at_s, message in self.arrived if isinstance(message, ODOMETRY)]

    def requests(self) -> set[int]:
        """Return the numbers of the messages that were asked for."""
        return {int(message.param1) for _, message in self.arrived if isinstance(message, COMMAND_LONG)}


@pytest.fixture
def film(tmp_path: Path) -> Recording:
    """Return a recording of 2 s of standing still."""
    options = SourceOptions(
        str(write_film(tmp_path / "film.avi", count=20)),
        calibration=write_calibration(tmp_path / "small.toml"),
        imu=write_inertial_csv(tmp_path / "imu.csv", 2.2),
    )
    return open_video(options)


def never() -> bool:
    return False


@pytest.mark.slow
def test_recording_becomes_odometry_at_its_rate(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    rig.live.run(never)
    sent = rig.odometry()
    assert rig.log.frames[-1].state is not VioState.INIT
    assert 20 <= len(sent) <= 34  # from about 0.6 s on, 20 per second
    assert all(later[0] - earlier[0] < 0.07 for earlier, later in itertools.pairwise(sent))
    assert max(abs(message.x) + abs(message.y) + abs(message.z) for _, message in sent) < 0.02
    assert {message.quality > 0 for _, message in sent} == {True}


@pytest.mark.slow
def test_stamps_of_messages_are_now_and_of_the_log_the_recording_s(
    monkeypatch: pytest.MonkeyPatch, film: Recording
) -> None:
    rig = Rig(monkeypatch, film)
    rig.live.run(never, delay_s=3.0)
    assert all(abs(message.time_usec * 1e-6 - 50 - at_s) < 0.1 for at_s, message in rig.odometry())
    assert [frame.t_ns // 10**6 for frame in rig.log.frames] == [100 * index for index in range(20)]


@pytest.mark.slow
def test_same_recording_gives_the_same_messages(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rigs = [Rig(monkeypatch, film) for _ in range(2)]
    for rig in rigs:
        monkeypatch.setattr(vio_live, "wait_readable", rig._wait)
        rig.live.run(never)
    assert repr(rigs[0].odometry()) == repr(rigs[1].odometry())  # NaN is not equal to itself


@pytest.mark.slow
def test_heartbeats_and_clock_requests_are_sent_meanwhile(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    rig.live.run(never, delay_s=5.0)
    counts = rig.counts()
    assert counts["HEARTBEAT"] == 8
    assert counts["TIMESYNC"] == pytest.approx(36, abs=2)
    assert rig.live.sent() == dict(sorted(counts.items()))


@pytest.mark.slow
def test_frames_wait_for_the_delay(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    rig.live.run(never, delay_s=5.0)
    assert rig.odometry()[0][0] > 5.5


def test_stop_ends_at_once(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    rig.live.run(lambda: len(rig.log.frames) >= 4)
    assert len(rig.log.frames) == 4


def test_without_a_link_nobody_is_told(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film, link=None)
    rig.live.run(never)
    assert len(rig.log.frames) == 20
    assert (rig.live.sent(), rig.live.wait_for_vehicle(1.0, never)) == ({}, False)


@pytest.mark.slow
def test_texts_of_the_vehicle_are_told(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    rig.say(STATUSTEXT(6, "EKF3 IMU0 is using external nav data"))
    rig.live.run(never)
    assert [(text.severity, text.text) for text in rig.texts] == [(6, "EKF3 IMU0 is using external nav data")]


def test_vehicle_is_waited_for(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    rig.on_wait = lambda: rig.say(ALIVE) if rig.now_ns - rig.start_ns > 2 * 10**9 else None
    assert rig.live.wait_for_vehicle(5.0, never)
    assert 2.0 < (rig.now_ns - rig.start_ns) * 1e-9 < 2.5
    assert rig.log.frames == []  # the recording has not begun


def test_patience_ends(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)
    assert not rig.live.wait_for_vehicle(2.0, never)
    assert (rig.now_ns - rig.start_ns) * 1e-9 == pytest.approx(2.0, abs=0.2)


@pytest.mark.slow
def test_heading_of_the_vehicle_turns_the_local_frame(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, film)

    def tell() -> None:
        rig.say(ATTITUDE(rig.now_ns // 10**6, *LEVEL_EAST))

    rig.on_wait = tell
    rig.live.run(never)
    w, _, _, z = rig.odometry()[0][1].q
    assert 2 * np.arctan2(z, w) == pytest.approx(np.pi / 2, abs=0.02)  # NED: it heads east
    assert rig.requests() == {30}  # ATTITUDE


@pytest.mark.slow
def test_known_north_asks_for_nothing(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    rig = Rig(monkeypatch, dataclasses.replace(film, world_is_north=True))
    rig.live.run(never)
    assert "COMMAND_LONG" not in rig.counts()


def test_known_start_is_taken(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    place = SE3(np.eye(3), np.array([7.0, 8.0, 9.0]))
    rig = Rig(
        monkeypatch,
        dataclasses.replace(film, start=WarmStartPose(place.inverse(), np.zeros(3), ImuBias.zero())),
        config=VioConfig(min_tracked=8),
    )
    rig.live.run(lambda: len(rig.log.frames) == 6)
    pose = rig.log.frames[-1].pose
    assert pose is not None
    np.testing.assert_allclose(pose.t, [7, 8, 9], atol=0.1)


@pytest.mark.slow
def test_heights_reach_the_strategy(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    heights: list[tuple[float, float]] = []
    monkeypatch.setattr(KltRansac, "add_height", lambda _self, _t_ns, height, sigma: heights.append((height, sigma)))

    def data() -> Iterable[SensorEvent]:
        for event in film.data():
            yield event
            if len(heights) < 2:
                yield HeightMeasurement(0, 12.0, 0.4)

    rig = Rig(monkeypatch, dataclasses.replace(film, data=lambda: iter(data())))
    rig.live.run(never)
    assert heights == [(12.0, 0.4)] * 2


def test_recording_that_breaks_raises(monkeypatch: pytest.MonkeyPatch, film: Recording) -> None:
    def data() -> Iterable[SensorEvent]:
        for number, event in enumerate(film.data()):
            if number == 100:
                raise SourceError("film: broken")
            yield event

    rig = Rig(monkeypatch, dataclasses.replace(film, data=lambda: iter(data())))
    with pytest.raises(SourceError, match="film: broken"):
        rig.live.run(never)


# A camera, for which the video stands in: it gives a picture whenever it is asked, about 20 per second here


def at_rest(now_ns: int) -> RAW_IMU:
    return RAW_IMU(now_ns // 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 0, 0, 0)


@pytest.fixture
def camera(film: Recording, tmp_path: Path) -> LiveCamera:
    config = VioConfig(agl_source=AglSource.RANGEFINDER, agl_sigma_m=0.7)
    return LiveCamera(str(write_film(tmp_path / "long.avi", count=25)), film.calibration, None, config)


@pytest.mark.slow
def test_camera_goes_with_the_autopilot_s_imu(monkeypatch: pytest.MonkeyPatch, camera: LiveCamera) -> None:
    rig = Rig(monkeypatch, camera)
    rig.on_wait = lambda: rig.say(at_rest(rig.now_ns - 1_000_000))
    rig.live.run(never, until_s=1.2)
    assert rig.log.frames[-1].state is not VioState.INIT
    assert len(rig.odometry()) > 10
    assert rig.requests() == {27, 30, 105, 132}  # RAW_IMU, ATTITUDE, HIGHRES_IMU, DISTANCE_SENSOR


def test_range_finder_of_the_autopilot_counts(monkeypatch: pytest.MonkeyPatch, camera: LiveCamera) -> None:
    heights: list[tuple[float, float]] = []
    monkeypatch.setattr(KltRansac, "add_height", lambda _self, _t_ns, height, sigma: heights.append((height, sigma)))
    rig = Rig(monkeypatch, camera)

    def tell() -> None:
        boot_ms = (rig.now_ns - 1_000_000) // 10**6
        rig.say(ATTITUDE(boot_ms, *LEVEL_EAST), DISTANCE_SENSOR(boot_ms, 10, 5000, 1234, 0, 1, 25, 0))

    rig.on_wait = tell
    rig.live.run(lambda: bool(heights), until_s=1.0)
    assert heights[0] == pytest.approx((12.34, 0.7))


@pytest.mark.slow
def test_camera_that_dies_ends_it(monkeypatch: pytest.MonkeyPatch, camera: LiveCamera) -> None:
    rig = Rig(monkeypatch, camera)
    rig.live.run(never)
    assert len(rig.log.frames) == 25
