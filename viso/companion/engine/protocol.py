# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes between viso and an engine that is a program; ``docs/engines.md`` and ``viso_engine.hpp`` say the same.

viso writes to the program's standard input and reads its standard output. Each message is a frame: the magic ``VISE``,
the kind (u32) and the length (u32) of what follows. All numbers are little-endian, all fields lie on multiples of their
own size, matrices go row by row. Stamps are nanoseconds of the IMU's clock; the world is ENU with gravity (0, 0, -g),
the body FLU with its origin in the IMU, a camera's x points right and y down; ``A_T_B`` maps from B to A. Units are m,
s, rad unless said.
"""

import dataclasses
import enum
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import numpy as np

from viso.companion.vio.se3 import Array

VERSION: Final = 1
MAGIC: Final = b"VISE"
HEADER: Final = struct.Struct("<4sII")
MOST_TEXT: Final = 1000
"""Of a text that an engine sends, in bytes."""

_NAME_BYTES: Final = 64
_BYTES: Final = "bytes"


class ProtocolError(Exception):
    """What an engine sent is no message, or says what cannot be; the text is one line."""


class Capability(enum.IntFlag):
    """What an engine can do."""

    STARTS_AT_REST = 1
    """It finds its state while the body stands still; else it needs motion."""
    TAKES_HEIGHT = 2
    """It makes use of HEIGHT."""
    HAS_COVARIANCE = 4
    """Its estimates have a covariance, of one kind or the other."""
    UPDATES_KEYFRAMES = 8
    """It sends KEYFRAME_UPDATE."""


class Status(enum.IntEnum):
    """How an engine is after an image."""

    INITIALISING = 0
    """There is no state."""
    TRACKING = 1
    """The image was used."""
    LOST = 2
    """The image could not be used: the IMU alone carries the state on."""
    FAILED = 3
    """Nothing that it says holds before a RESET."""


class CovarianceKind(enum.IntEnum):
    """What the numbers of an estimate's covariance are."""

    NONE = 0
    RELATIVE = 1
    """The first 36: of ``keyframe_T_body``, right perturbation, (rx, ry, rz, tx, ty, tz) in the body."""
    JOINT = 2
    """All 144: of keyframe and body together, each (rotation, right perturbation; position, in the world)."""


def _wire(code: str, text: str) -> Any:
    """Return a field: what it is, as of ``struct`` or a number of bytes up to the end, and what it means."""
    return dataclasses.field(metadata={"code": code, "text": text})


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Setup:
    """The first message: the camera, the IMU and what else does not change."""

    fx: float = _wire("d", "px; the middle of the first pixel is (0, 0)")
    fy: float = _wire("d", "px")
    cx: float = _wire("d", "px")
    cy: float = _wire("d", "px")
    distortion: Array = _wire("8d", "k1 k2 p1 p2 k3 (radtan), k1 k2 k3 k4 (equidistant), then zeros")
    body_T_camera: Array = _wire("16d", "where the camera is")
    body_T_camera_sigma: Array = _wire("2d", "of it: rotation, position; 0 for exact")
    time_offset_s: float = _wire("d", "what was added to the camera's stamps to get those of IMAGE, in the IMU's time")
    time_offset_sigma_s: float = _wire("d", "of it; 0 for exact")
    line_time_s: float = _wire("d", "from a line of the picture to the next; 0 for a global shutter")
    gyro_noise: float = _wire("d", "density, rad/s/sqrt(Hz)")
    accel_noise: float = _wire("d", "density, m/s^2/sqrt(Hz)")
    gyro_walk: float = _wire("d", "density, rad/s^2/sqrt(Hz)")
    accel_walk: float = _wire("d", "density, m/s^3/sqrt(Hz)")
    imu_rate_hz: float = _wire("d", "samples a second")
    gyro_limit: float = _wire("d", "rad/s at which the gyro saturates; infinite if not known")
    accel_limit: float = _wire("d", "m/s^2 at which the accelerometer saturates; infinite if not known")
    gravity: float = _wire("d", "m/s^2")
    width: int = _wire("I", "of the pictures, px")
    height: int = _wire("I", "of the pictures, px")
    distortion_model: int = _wire("I", "0 none, 1 radtan, 2 equidistant")
    max_features: int = _wire("I", "that are tracked at a time")
    threads: int = _wire("I", "that may be used")
    seed: int = _wire("I", "of all that is random")
    mask: bytes = _wire(_BYTES, "nothing, or width * height: 0 where the picture is not to be used")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Options:
    """The table ``vio.native`` of the configuration."""

    text: bytes = _wire(_BYTES, "lines name=value, UTF-8; true and false for what is either")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SharedMemory:
    """Where pictures may be put; an engine that cannot map it says so in READY, and gets them in IMAGE."""

    size: int = _wire("Q", "bytes")
    descriptor: int = _wire("I", "an open file of that size")
    zero: int = _wire("I", "0")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reset:
    """Forget all; start from a state that holds at the next image, or find one without help."""

    world_T_body: Array = _wire("16d", "the pose")
    velocity_world: Array = _wire("3d", "m/s")
    accel_bias: Array = _wire("3d", "m/s^2")
    gyro_bias: Array = _wire("3d", "rad/s")
    covariance: Array = _wire(
        "225d",
        "of (attitude, right perturbation; position, world; velocity, world; gyro bias; accelerometer bias)",
    )
    has_state: int = _wire("I", "0: all other fields say nothing")
    zero: int = _wire("I", "0")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Imu:
    """Samples; their stamps increase. Those up to an image come before it, and one beyond it."""

    samples: bytes = _wire(
        _BYTES, "of each: stamp (i64, ns), specific force (3 f64, m/s^2), rotation rate (3 f64, rad/s)"
    )


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Height:
    """A height of the body above the ground; only for an engine that takes it."""

    t_ns: int = _wire("q", "stamp")
    height_m: float = _wire("d", "along the vertical")
    sigma_m: float = _wire("d", "of it")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Image:
    """A grey picture, row by row, without gaps; answered by ESTIMATE."""

    t_ns: int = _wire("q", "stamp")
    image_id: int = _wire("Q", "one more with each, from 1")
    width: int = _wire("I", "px")
    height: int = _wire("I", "px")
    in_shared_memory: int = _wire("I", "1: at its begin; valid until the answer")
    zero: int = _wire("I", "0")
    pixels: bytes = _wire(_BYTES, "width * height, or nothing if they are in shared memory")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Hello:
    """The first message."""

    imu_rate_hz: float = _wire("d", "the most samples a second that it wants; 0 for all")
    version: int = _wire("I", f"of the protocol: {VERSION}")
    capabilities: int = _wire("I", "bits, see below")
    image_width_px: int = _wire("I", "the widest picture that it wants; 0 for any")
    zero: int = _wire("I", "0")
    name: bytes = _wire(f"{_NAME_BYTES}s", "of the engine, ASCII, zeros at the end")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ready:
    """The answer to the first RESET: the engine is made."""

    shared_memory: int = _wire("I", "1: it has mapped the shared memory")
    zero: int = _wire("I", "0")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Estimate:
    """The answer to an image. INITIALISING and FAILED need nothing but the identifier and the status."""

    t_ns: int = _wire("q", "the image's stamp")
    image_id: int = _wire("Q", "the image's")
    keyframe_id: int = _wire("Q", "the image of keyframe K: the last one before this that was a keyframe, or itself")
    world_T_body: Array = _wire("16d", "the body in the engine's world")
    keyframe_T_body: Array = _wire("16d", "the body in K's body; identity where K is this image")
    velocity_world: Array = _wire("3d", "m/s")
    accel_bias: Array = _wire("3d", "m/s^2")
    gyro_bias: Array = _wire("3d", "rad/s")
    mean_parallax_px: float = _wire("d", "after removing rotation")
    mre_px: float = _wire("d", "mean reprojection error, over the inliers")
    coverage: float = _wire("d", "share of the picture that has inliers, 0 to 1")
    innovation_ratio: float = _wire(
        "d", "mean normalised residual squared per degree of freedom, inliers; 1 if unknown"
    )
    covariance: Array = _wire("144d", "by its kind, row by row from the first number on")
    status: int = _wire("I", "see below")
    is_keyframe: int = _wire("I", "1: this image is the keyframe of those after it")
    covariance_kind: int = _wire("I", "see below")
    tracked: int = _wire("I", "features found again")
    lost: int = _wire("I", "features not found again")
    fresh: int = _wire("I", "features that are new")
    inliers: int = _wire("I", "features that agree with the estimate")
    zero: int = _wire("I", "0")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeyframeUpdate:
    """A better pose of a keyframe, in the engine's world, ahead of the estimate of the same image."""

    keyframe_id: int = _wire("Q", "its image")
    world_T_keyframe: Array = _wire("16d", "the body there")
    is_loop_closure: int = _wire("I", "1: a place was seen again, 0: refined by what came after")
    zero: int = _wire("I", "0")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Log:
    """A line for the log; at any time."""

    level: int = _wire("I", "10 debug, 20 info, 30 warning, 40 error")
    text: bytes = _wire(_BYTES, f"UTF-8, at most {MOST_TEXT} bytes")


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Failure:
    """The last message of an engine that gives up: why."""

    text: bytes = _wire(_BYTES, f"UTF-8, one line, at most {MOST_TEXT} bytes")


Message = (
    Setup
    | Options
    | SharedMemory
    | Reset
    | Imu
    | Height
    | Image
    | Hello
    | Ready
    | Estimate
    | KeyframeUpdate
    | Log
    | Failure
)
M = TypeVar("M", bound=Message)

FROM_VISO: Final[dict[int, type[Message]]] = {
    1: Setup,
    2: Options,
    3: SharedMemory,
    4: Reset,
    5: Imu,
    6: Height,
    7: Image,
}
FROM_ENGINE: Final[dict[int, type[Message]]] = {
    101: Hello,
    102: Ready,
    103: Estimate,
    104: KeyframeUpdate,
    105: Log,
    106: Failure,
}
IMU_SAMPLE: Final = np.dtype([("t_ns", "<i8"), ("accel", "<f8", 3), ("gyro", "<f8", 3)])


class _Layout:
    """How a kind of message lies in bytes."""

    def __init__(self, kind: type[Message]) -> None:
        codes = [(field.name, field.metadata["code"]) for field in dataclasses.fields(kind)]
        self.tail = codes.pop()[0] if codes[-1][1] == _BYTES else None
        self.arrays = {name: struct.Struct(f"<{code}") for name, code in codes if code[-1] == "d" and code != "d"}
        self.names = [name for name, _ in codes]
        # An array is one item of bytes.
        plain = (f"{self.arrays[name].size}s" if name in self.arrays else code for name, code in codes)
        self.struct = struct.Struct("<" + "".join(plain))

    def packed(self, message: Message) -> bytes:
        values = [self._plain(name, getattr(message, name)) for name in self.names]
        return self.struct.pack(*values) + (getattr(message, self.tail) if self.tail else b"")

    def _plain(self, name: str, value: Any) -> Any:
        if name not in self.arrays:
            return value
        return np.asarray(value, "<f8").tobytes().ljust(self.arrays[name].size, b"\0")

    def read(self, payload: bytes) -> dict[str, Any]:
        """Raises struct.error if the length is wrong."""
        fixed = payload[: self.struct.size] if self.tail else payload
        values = dict(zip(self.names, self.struct.unpack(fixed), strict=True))
        for name in self.arrays:
            values[name] = np.frombuffer(values[name], "<f8")
        return values | ({self.tail: payload[self.struct.size :]} if self.tail else {})


_LAYOUTS: Final = {kind: _Layout(kind) for kind in (*FROM_VISO.values(), *FROM_ENGINE.values())}
_NUMBERS: Final = {kind: number for kinds in (FROM_VISO, FROM_ENGINE) for number, kind in kinds.items()}
_LONGEST: Final = max(_LAYOUTS[kind].struct.size + MOST_TEXT for kind in FROM_ENGINE.values())


def frame_of(message: Message) -> bytes:
    """Return a message as bytes; arrays that are too short are filled with zeros."""
    payload = _LAYOUTS[type(message)].packed(message)
    return HEADER.pack(MAGIC, _NUMBERS[type(message)], len(payload)) + payload


def nothing(kind: type[M]) -> dict[str, Any]:
    """Return values for all fields of a kind that say nothing: zeros, and matrices of poses that are identities."""
    layout = _LAYOUTS[kind]
    values = layout.read(bytes(layout.struct.size))
    return values | {name: np.eye(4).ravel() for name in values if "_T_" in name and len(values[name]) == 16}


class Decoder:
    """Makes messages of the bytes of the other side.

    Args:
        kinds: that may come.
        longest: of a message in bytes, without its header.
    """

    def __init__(self, kinds: dict[int, type[Message]], longest: int = _LONGEST) -> None:
        self._kinds, self._longest = kinds, longest
        self._buffer = bytearray()

    def feed(self, data: bytes) -> Iterator[Message]:
        """Take bytes; yield the messages that are complete with them.

        Raises:
            ProtocolError: if what came is none, and nothing that comes after can be trusted either.
        """
        self._buffer += data
        while (begin := self._begin()) is not None:
            number, length = begin
            if len(self._buffer) < HEADER.size + length:
                return
            payload = bytes(self._buffer[HEADER.size : HEADER.size + length])
            del self._buffer[: HEADER.size + length]
            kind = self._kinds[number]
            try:
                yield kind(**_LAYOUTS[kind].read(payload))
            except struct.error:
                raise ProtocolError(f"{kind.__name__} of {length} bytes") from None

    def _begin(self) -> tuple[int, int] | None:
        """Return kind and length of the message at the begin of the buffer; None where it is too short to tell."""
        if not MAGIC.startswith(self._buffer[: len(MAGIC)]):
            raise ProtocolError(f"no message: {bytes(self._buffer[:16])!r}")
        if len(self._buffer) < HEADER.size:
            return None
        _, number, length = HEADER.unpack_from(self._buffer)
        if number not in self._kinds:
            raise ProtocolError(f"message of unknown kind {number}")
        if length > self._longest:
            raise ProtocolError(f"{self._kinds[number].__name__} of {length} bytes")
        return number, length
