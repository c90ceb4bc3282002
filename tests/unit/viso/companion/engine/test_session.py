# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What an engine is told, what it may answer, and what it may not."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.unit.viso.companion.vio.strategy_rig import make_calibration, make_warm_start
from viso.companion.engine import session as session_module
from viso.companion.engine.child import EngineFailure
from viso.companion.engine.protocol import (
    FROM_VISO,
    IMU_SAMPLE,
    Decoder,
    Estimate,
    Height,
    Hello,
    Image,
    Imu,
    KeyframeUpdate,
    Message,
    Options,
    Ready,
    Reset,
    Setup,
    SharedMemory,
    Status,
    nothing,
)
from viso.companion.engine.session import EngineSession, relative_covariance
from viso.companion.vio.config import EngineConfig, VioConfig
from viso.companion.vio.types import CameraCalibration, Pixels
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array, so3_exp

GREY: Pixels = np.arange(48 * 64, dtype=np.uint64).reshape(48, 64).astype(np.uint8)
HELLO = {"version": 1, "name": b"wax"}


class WaxChild:
    """A process that is none: remembers what it is told, says what a test wants.

    Attributes:
        told: the messages.
        hello, estimate: fields of what it says; those of estimates may be left to it.
        before: messages ahead of the next estimate.
    """

    shares = True
    wanted_width_px = 0
    dropped_lines = 0
    pid = 1

    def __init__(self, command: str, on_line: object) -> None:
        self.command = command
        self.told = list[Message]()
        self.memory = b""
        self.hello = {**HELLO, "image_width_px": self.wanted_width_px}
        self.estimate: dict[str, Any] = {}
        self.before = list[Message]()
        self.closed = False
        self._decoder = Decoder(FROM_VISO, 10_000_000)

    def share(self, size: int) -> SharedMemory | None:
        return SharedMemory(size=size, descriptor=77, zero=0) if self.shares else None

    def put(self, pixels: bytes) -> None:
        self.memory = pixels

    def close(self, **_: object) -> None:
        self.closed = True

    def exchange(
        self, frames: Iterable[bytes], until: type[Message], timeout_s: float
    ) -> tuple[list[Message], Message]:
        self.told += [message for frame in frames for message in self._decoder.feed(frame)]
        if until is Hello:
            return [], Hello(**nothing(Hello) | self.hello)
        if until is Ready:
            return [], Ready(shared_memory=int(self.shares), zero=0)
        image = self.last(Image)
        usual = {"image_id": image.image_id, "keyframe_id": image.image_id, "status": Status.TRACKING}
        return self.before, Estimate(**nothing(Estimate) | usual | self.estimate)

    def last(self, kind: type[Any]) -> Any:
        return [message for message in self.told if isinstance(message, kind)][-1]


@pytest.fixture(autouse=True)
def wax(monkeypatch: pytest.MonkeyPatch) -> type[WaxChild]:
    """Let a class of wax, which a test may mould, be the processes."""
    kind = type("Wax", (WaxChild,), {})
    monkeypatch.setattr(session_module, "EngineChild", kind)
    return kind


def begin(calibration: CameraCalibration | None = None, **config: Any) -> tuple[EngineSession, WaxChild]:
    session = EngineSession("./wax", calibration or make_calibration(), VioConfig(**config), print)
    assert isinstance(session.child, WaxChild)
    return session, session.child


def test_first_words() -> None:
    calibration = make_calibration(imu_rate_hz=200.0, line_time_s=2e-5, rotation_sigma_rad=0.01, time_offset_s=0.004)
    session, child = begin(calibration, native={"loops": True, "time_s": 0.04, "file": "a b"}, seed=3)
    assert [type(message) for message in child.told] == [Setup, Options, SharedMemory, Reset]
    setup = child.last(Setup)
    assert (setup.width, setup.height, setup.fx, setup.seed, setup.mask) == (64, 48, 50.0, 3, b"")
    assert (setup.imu_rate_hz, setup.line_time_s, setup.time_offset_s) == (200.0, 2e-5, 0.004)
    assert setup.body_T_camera_sigma.tolist() == [0.01, 0.0]
    assert (setup.gyro_limit, setup.gravity) == (math.inf, 9.80665)
    assert child.last(Options).text == b"loops=true\ntime_s=0.04\nfile=a b\n"
    assert child.last(SharedMemory).size == 64 * 48
    assert child.last(Reset).has_state == 0
    assert session.name == "wax"


def test_pictures_are_no_wider_than_wanted(wax: type[WaxChild]) -> None:
    wax.wanted_width_px = 40
    session, child = begin()
    assert (child.last(Setup).width, child.last(Setup).fx) == (32, 25.0)
    session.add_image(1, GREY)
    assert (child.last(Image).width, child.last(Image).height, len(child.memory)) == (32, 24, 768)


@pytest.mark.parametrize("shares", [True, False])
def test_pixels_go_through_shared_memory_or_the_pipe(wax: type[WaxChild], shares: bool) -> None:
    wax.shares = shares
    session, child = begin()
    session.add_image(7, GREY)
    told = child.last(Image)
    assert (told.t_ns, told.image_id, told.in_shared_memory) == (7, 1, int(shares))
    assert (child.memory, told.pixels) == ((GREY.tobytes(), b"") if shares else (b"", GREY.tobytes()))


def test_what_comes_between_images_goes_with_the_next_in_order() -> None:
    session, child = begin()
    session.add_imu(5, np.array([1.0, 2, 3]), np.array([4.0, 5, 6]))
    session.add_height(6, 40.0, 0.3)
    session.reset(make_warm_start())
    assert len(child.told) == 4
    session.add_image(7, GREY)
    imu, height, reset, image = child.told[4:]
    assert isinstance(imu, Imu)
    (sample,) = np.frombuffer(imu.samples, IMU_SAMPLE)
    assert (sample["t_ns"], *sample["accel"], *sample["gyro"]) == (5, 1, 2, 3, 4, 5, 6)
    assert isinstance(height, Height)
    assert (height.t_ns, height.height_m, height.sigma_m) == (6, 40.0, 0.3)
    assert isinstance(reset, Reset)
    pose = make_warm_start().body_T_world.inverse()
    assert reset.world_T_body.reshape(4, 4) == pytest.approx(pose.matrix())
    assert reset.velocity_world == pytest.approx(pose.R[:, 0])
    assert np.diag(reset.covariance.reshape(15, 15))[6:9] == pytest.approx(0.09)
    assert isinstance(image, Image)


def test_mask_is_that_of_a_picture(tmp_path: Path) -> None:
    mask = np.zeros((96, 128), np.uint8)
    mask[:48] = 255
    file = str(tmp_path / "mask.png")
    cv2.imwrite(file, mask)
    _, child = begin(engine=EngineConfig(mask=file))
    assert child.last(Setup).mask == b"\xff" * 24 * 64 + bytes(24 * 64)


@pytest.mark.parametrize(
    ("config", "text"),
    [
        ({"engine": EngineConfig(mask="/nowhere.png")}, "vio.engine.mask: /nowhere.png: no picture"),
        ({"native": {"a": "b\nc"}}, "vio.native.a: a line break, or = in the name"),
        ({"native": {"a=b": 1}}, "vio.native.a=b: a line break, or = in the name"),
    ],
)
def test_what_cannot_be_told_is_refused(config: dict[str, Any], text: str) -> None:
    with pytest.raises(EngineFailure, match=f"^{text}$"):
        begin(**config)


def test_another_version_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(HELLO, "version", 2)
    with pytest.raises(EngineFailure, match=r"^protocol of version 2, this is 1$"):
        begin()


@pytest.mark.parametrize(
    "lie",
    [
        {"image_id": 2},
        {"status": 4},
        {"covariance_kind": 3},
        {"keyframe_id": 9},
        {"world_T_body": (2 * np.eye(4)).ravel()},
        {"world_T_body": np.full(16, np.nan)},
        {"keyframe_T_body": np.zeros(16)},
        {"velocity_world": np.full(3, np.inf)},
        {"velocity_world": np.full(3, 1e8)},
        {"gyro_bias": np.full(3, np.nan)},
        {"covariance_kind": 1, "covariance": np.full(144, np.nan)},
        {"coverage": 1.1},
        {"coverage": math.nan},
        {"mre_px": -1.0},
        {"innovation_ratio": math.nan},
    ],
)
def test_estimate_that_cannot_be_is_refused(lie: dict[str, Any]) -> None:
    session, child = begin()
    child.estimate = lie
    with pytest.raises(EngineFailure, match=r"^estimate: .+$") as caught:
        session.add_image(1, GREY)
    assert caught.value.kind == "protocol_errors"


@pytest.mark.parametrize("status", [Status.INITIALISING, Status.FAILED])
def test_without_a_state_nothing_else_is_looked_at(status: Status) -> None:
    session, child = begin()
    child.estimate = {"status": status, "world_T_body": np.full(16, np.nan), "keyframe_id": 9}
    assert session.add_image(1, GREY)[1].status == status


def test_keyframes_are_those_that_were_told() -> None:
    session, child = begin()
    keyframes = [(1, 0), (1, 0), (1, 1), (3, 0)]
    for number, (keyframe_id, is_keyframe) in enumerate(keyframes, 1):
        child.estimate = {"keyframe_id": keyframe_id, "is_keyframe": is_keyframe}
        session.add_image(100 * number, GREY)
    assert session.keyframes_ns == {1: 100, 3: 300}
    child.estimate = {"keyframe_id": 1}
    with pytest.raises(EngineFailure, match=r"^estimate: keyframe 1, the last one is 3$"):
        session.add_image(500, GREY)


def test_updates_of_keyframes_come_with_the_estimate() -> None:
    session, child = begin()
    update = KeyframeUpdate(**nothing(KeyframeUpdate) | {"keyframe_id": 1})
    child.before = [update]
    assert session.add_image(1, GREY)[0] == [update]
    child.before = [KeyframeUpdate(**nothing(KeyframeUpdate) | {"world_T_keyframe": np.zeros(16)})]
    with pytest.raises(EngineFailure, match=r"^estimate: "):
        session.add_image(2, GREY)


def test_failure_at_the_start_leaves_nothing(wax: type[WaxChild], monkeypatch: pytest.MonkeyPatch) -> None:
    children = list[WaxChild]()

    def share(self: WaxChild, size: int) -> None:
        children.append(self)
        raise OSError("no memory")

    monkeypatch.setattr(wax, "share", share)
    with pytest.raises(OSError, match="no memory"):
        begin()
    assert children[0].closed


def test_relative_covariance_is_that_of_disturbed_poses() -> None:
    keyframe = SE3.exp(np.array([0.3, -0.2, 1.0, 4.0, 5.0, 6.0]))
    body = SE3.exp(np.array([-0.1, 0.4, 1.2, 5.0, 3.0, 6.5]))
    relative = keyframe.inverse() @ body

    def disturbed(error: Array) -> Array:
        K, B = (
            SE3(pose.R @ so3_exp(part[:3]), pose.t + part[3:])
            for pose, part in ((keyframe, error[:6]), (body, error[6:]))
        )
        return (relative.inverse() @ K.inverse() @ B).log()

    step = 1e-6
    jacobian = np.array([disturbed(step * axis) for axis in np.eye(12)]).T / step
    root = np.random.default_rng(1).normal(size=(12, 12))
    joint = root @ root.T
    assert relative_covariance(joint, relative, keyframe.R) == pytest.approx(jacobian @ joint @ jacobian.T, rel=1e-4)
