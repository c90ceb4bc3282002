# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A base for engine programs in Python, as ``viso_engine.hpp`` is for those in C++.

``raise SystemExit(run(MyEngine()))`` is such a program. Its prints go to viso's log.
"""

import mmap
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, BinaryIO, Final

import numpy as np

from viso.companion.engine.protocol import (
    FROM_VISO,
    IMU_SAMPLE,
    MOST_TEXT,
    VERSION,
    Capability,
    Decoder,
    Estimate,
    Failure,
    Height,
    Hello,
    Image,
    Imu,
    KeyframeUpdate,
    Log,
    Message,
    Options,
    Ready,
    Reset,
    Setup,
    SharedMemory,
    Status,
    frame_of,
    nothing,
)
from viso.companion.vio.types import Pixels
from viso.geometry.rotation import Array

_LONGEST: Final = 1 << 30
_READ_BYTES: Final = 1 << 20


class EngineProgram(ABC):
    """An engine; an exception ends the program and appears in viso's log.

    Attributes:
        name: ASCII, at most 63 letters.
        capabilities: what it can do.
        image_width_px: the widest picture that it accepts; 0 for any.
        imu_rate_hz: the least samples per second; 0 for any.
    """

    name = "engine"
    capabilities = Capability.STARTS_AT_REST
    image_width_px = 0
    imu_rate_hz = 0.0

    _output: BinaryIO | None = None

    @abstractmethod
    def set_up(self, setup: Setup, options: Mapping[str, str]) -> None:
        """Receive the constant settings; called once, first.

        Args:
            setup: camera and IMU.
            options: the configuration's table ``vio.native``.
        """

    @abstractmethod
    def reset(self, start: Reset | None) -> None:
        """Discard the state; start from a state valid at the next image, or find one without help."""

    @abstractmethod
    def add_imu(self, t_ns: int, accel: Array, gyro: Array) -> None:
        """Add a sample (m/s^2, rad/s; FLU)."""

    def add_height(self, t_ns: int, height_m: float, sigma_m: float) -> None:  # noqa: B027  # optional for engines
        """Add a height above the ground."""

    @abstractmethod
    def add_image(self, t_ns: int, pixels: Pixels, image_id: int) -> Mapping[str, Any] | None:
        """Process a grey image [H, W], which is valid until this returns.

        Returns:
            Fields of ``Estimate`` that differ from ``nothing``, with ``status`` TRACKING by default; None while there
            is no state. The stamp, the identifiers and the first keyframe are filled in.
        """

    def log(self, text: str, level: int = 20) -> None:
        """Write a line to viso's log."""
        self._send(Log(level=level, text=text.encode()[:MOST_TEXT]))

    def update_keyframe(self, keyframe_id: int, world_T_keyframe: Array, *, is_loop_closure: bool) -> None:
        """Send a better pose [4, 4] of a keyframe, from within ``add_image``."""
        self._send(
            KeyframeUpdate(
                keyframe_id=keyframe_id,
                world_T_keyframe=world_T_keyframe,
                is_loop_closure=int(is_loop_closure),
                zero=0,
            )
        )

    def _send(self, message: Message) -> None:
        assert self._output is not None
        self._output.write(frame_of(message))
        self._output.flush()


class _Session:
    """Speaks the protocol for an engine."""

    def __init__(self, engine: EngineProgram) -> None:
        self._engine = engine
        self._setup: Setup | None = None
        self._options: dict[str, str] = {}
        self._shared: mmap.mmap | None = None
        self._is_ready = False
        self._keyframe_id = 0

    def take(self, message: Message) -> None:
        """Process a message."""
        engine = self._engine
        if isinstance(message, Setup):
            self._setup = message
        elif isinstance(message, Options):
            self._options = dict(line.split("=", 1) for line in message.text.decode().splitlines())
        elif isinstance(message, SharedMemory):
            if os.fstat(message.descriptor).st_size == message.size:
                self._shared = mmap.mmap(message.descriptor, message.size, prot=mmap.PROT_READ)
        elif isinstance(message, Reset):
            self._reset(message)
        elif isinstance(message, Imu):
            for t_ns, accel, gyro in np.frombuffer(message.samples, IMU_SAMPLE):
                engine.add_imu(int(t_ns), accel, gyro)
        elif isinstance(message, Height):
            engine.add_height(message.t_ns, message.height_m, message.sigma_m)
        elif isinstance(message, Image):
            engine._send(self._estimate(message))

    def _reset(self, message: Reset) -> None:
        if not self._is_ready:
            assert self._setup is not None
            self._engine.set_up(self._setup, self._options)
        self._keyframe_id = 0
        self._engine.reset(message if message.has_state else None)
        if not self._is_ready:
            self._is_ready = True
            self._engine._send(Ready(shared_memory=int(self._shared is not None), zero=0))

    def _estimate(self, image: Image) -> Estimate:
        size = image.width * image.height
        data = image.pixels
        if image.in_shared_memory:
            assert self._shared is not None
            data = self._shared[:size]
        pixels = np.frombuffer(data, np.uint8, size).reshape(image.height, image.width)
        answer = self._engine.add_image(image.t_ns, pixels, image.image_id)
        fields = nothing(Estimate) | {"innovation_ratio": 1.0, "t_ns": image.t_ns, "image_id": image.image_id}
        if answer is not None:
            fields |= {"status": Status.TRACKING, "is_keyframe": not self._keyframe_id} | dict(answer)
            fields["keyframe_id"] = self._keyframe_id or image.image_id
            if fields["is_keyframe"] or not self._keyframe_id:
                self._keyframe_id, fields["is_keyframe"] = image.image_id, True
        return Estimate(**fields)


def run(engine: EngineProgram) -> int:
    """Serve viso until it closes the connection; return the program's exit code."""
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # prints must not enter the protocol
    sys.stdout = sys.stderr  # unbuffered
    engine._output = output
    hello = Hello(
        imu_rate_hz=engine.imu_rate_hz,
        version=VERSION,
        capabilities=int(engine.capabilities),
        image_width_px=engine.image_width_px,
        zero=0,
        name=engine.name.encode("ascii"),
    )
    engine._send(hello)
    session, decoder = _Session(engine), Decoder(FROM_VISO, _LONGEST)
    try:
        while data := os.read(0, _READ_BYTES):
            for message in decoder.feed(data):
                session.take(message)
    except BrokenPipeError:
        return 0
    except Exception as error:
        engine._send(Failure(text=f"{type(error).__name__}: {error}".encode()[:MOST_TEXT]))
        return 1
    return 0
