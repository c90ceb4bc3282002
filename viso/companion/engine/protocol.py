# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The bytes between viso and an engine that is a program; ``docs/engines.md`` and ``viso_engine.hpp`` say the same.

viso writes to the program's standard input and reads its standard output. Each message is a frame: the magic ``VISE``,
the kind (u32) and the length (u32) of what follows. All numbers are little-endian, all fields lie on multiples of their
own size, matrices go row by row. Stamps are nanoseconds of the IMU's clock; the world is ENU with gravity (0, 0, -g),
the body FLU with its origin in the IMU, a camera's x points right and y down; ``A_T_B`` maps from B to A. Units are m,
s, rad unless said.
"""

import enum
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, Final, TypeVar, get_type_hints

import numpy as np

from viso.geometry.rotation import Array

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
    """It uses HEIGHT."""
    HAS_COVARIANCE = 4
    """Its estimates have a covariance, RELATIVE or JOINT."""
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
    """Nothing in its estimates holds before a RESET."""


class CovarianceKind(enum.IntEnum):
    """What the numbers of an estimate's covariance are."""

    NONE = 0
    """There is no covariance."""
    RELATIVE = 1
    """The first 36: of ``keyframe_T_body``, right perturbation, (rx, ry, rz, tx, ty, tz) in the body."""
    JOINT = 2
    """All 144: of keyframe and body together, each (rotation, right perturbation; position, in the world)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Setup:
    """The first message: the camera, the IMU and what else does not change."""

    fx: Annotated[float, "d", "px; the middle of the first pixel is (0, 0)"]
    fy: Annotated[float, "d", "px"]
    cx: Annotated[float, "d", "px"]
    cy: Annotated[float, "d", "px"]
    distortion: Annotated[Array, "8d", "k1 k2 p1 p2 k3 (radtan), k1 k2 k3 k4 (equidistant), then zeros"]
    body_T_camera: Annotated[Array, "16d", "where the camera is"]
    body_T_camera_sigma: Annotated[Array, "2d", "sigma of rotation and position; 0 for exact"]
    time_offset_s: Annotated[
        float, "d", "what viso adds to the camera's stamps to get those of IMAGE, in the IMU's time"
    ]
    time_offset_sigma_s: Annotated[float, "d", "sigma of time_offset_s; 0 for exact"]
    line_time_s: Annotated[float, "d", "time from a line of the picture to the next; 0 for a global shutter"]
    gyro_noise: Annotated[float, "d", "density, rad/s/sqrt(Hz)"]
    accel_noise: Annotated[float, "d", "density, m/s^2/sqrt(Hz)"]
    gyro_walk: Annotated[float, "d", "density, rad/s^2/sqrt(Hz)"]
    accel_walk: Annotated[float, "d", "density, m/s^3/sqrt(Hz)"]
    imu_rate_hz: Annotated[float, "d", "samples per second; 0 if not known"]
    gyro_limit: Annotated[float, "d", "rad/s at which the gyro saturates; infinite if not known"]
    accel_limit: Annotated[float, "d", "m/s^2 at which the accelerometer saturates; infinite if not known"]
    gravity: Annotated[float, "d", "m/s^2"]
    width: Annotated[int, "I", "width of the pictures, px"]
    height: Annotated[int, "I", "height of the pictures, px"]
    distortion_model: Annotated[int, "I", "0 none, 1 radtan, 2 equidistant"]
    max_features: Annotated[int, "I", "most features to track at a time"]
    threads: Annotated[int, "I", "most threads to use"]
    seed: Annotated[int, "I", "seed of all random numbers"]
    mask: Annotated[bytes, _BYTES, "empty, or width * height bytes: 0 where the picture must not be used"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Options:
    """The table ``vio.native`` of the configuration."""

    text: Annotated[bytes, _BYTES, "lines name=value, UTF-8; booleans are true or false"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SharedMemory:
    """Memory for pictures. An engine that cannot map it says so in READY, and gets the pictures in IMAGE."""

    size: Annotated[int, "Q", "bytes"]
    descriptor: Annotated[int, "I", "an open file of that size"]
    zero: Annotated[int, "I", "0"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Reset:
    """Forget everything. Start from a state that holds at the next image, or find one."""

    world_T_body: Annotated[Array, "16d", "the pose"]
    velocity_world: Annotated[Array, "3d", "m/s"]
    accel_bias: Annotated[Array, "3d", "m/s^2"]
    gyro_bias: Annotated[Array, "3d", "rad/s"]
    covariance: Annotated[
        Array,
        "225d",
        "order: attitude (right perturbation), position and velocity (world), gyro bias, accelerometer bias",
    ]
    has_state: Annotated[int, "I", "0: ignore all other fields"]
    zero: Annotated[int, "I", "0"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Imu:
    """Samples; their stamps increase. Those up to an image come before it, and one beyond it."""

    samples: Annotated[
        bytes, _BYTES, "of each: stamp (i64, ns), specific force (3 f64, m/s^2), rotation rate (3 f64, rad/s)"
    ]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Height:
    """A height of the body above the ground; only for an engine that takes it."""

    t_ns: Annotated[int, "q", "stamp"]
    height_m: Annotated[float, "d", "along the vertical"]
    sigma_m: Annotated[float, "d", "sigma of the height"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Image:
    """A grey picture, row by row, without gaps; answered by ESTIMATE."""

    t_ns: Annotated[int, "q", "stamp"]
    image_id: Annotated[int, "Q", "1 for the first image, then one more each"]
    width: Annotated[int, "I", "px"]
    height: Annotated[int, "I", "px"]
    in_shared_memory: Annotated[int, "I", "1: the picture is at the start of the shared memory, valid until the answer"]
    zero: Annotated[int, "I", "0"]
    pixels: Annotated[bytes, _BYTES, "width * height bytes; empty if they are in shared memory"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Hello:
    """The first message."""

    imu_rate_hz: Annotated[float, "d", "least samples per second; viso warns below that; 0 for any"]
    version: Annotated[int, "I", f"version of the protocol: {VERSION}"]
    capabilities: Annotated[int, "I", "bits, see below"]
    image_width_px: Annotated[int, "I", "width of the widest picture that it takes; 0 for any"]
    zero: Annotated[int, "I", "0"]
    name: Annotated[bytes, f"{_NAME_BYTES}s", "name of the engine, ASCII, zeros at the end"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Ready:
    """The answer to the first RESET: the engine is ready."""

    shared_memory: Annotated[int, "I", "1: it has mapped the shared memory"]
    zero: Annotated[int, "I", "0"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Estimate:
    """The answer to an image. INITIALISING and FAILED need nothing but the identifier and the status."""

    t_ns: Annotated[int, "q", "the image's stamp"]
    image_id: Annotated[int, "Q", "the image's"]
    keyframe_id: Annotated[int, "Q", "the image of keyframe K: the last one before this that was a keyframe, or itself"]
    world_T_body: Annotated[Array, "16d", "the body in the engine's world"]
    keyframe_T_body: Annotated[Array, "16d", "the body in K's body; identity where K is this image"]
    velocity_world: Annotated[Array, "3d", "m/s"]
    accel_bias: Annotated[Array, "3d", "m/s^2"]
    gyro_bias: Annotated[Array, "3d", "rad/s"]
    mean_parallax_px: Annotated[float, "d", "after removing rotation"]
    mre_px: Annotated[float, "d", "mean reprojection error, over the inliers"]
    coverage: Annotated[float, "d", "share of the picture that has inliers, 0 to 1"]
    innovation_ratio: Annotated[
        float, "d", "mean normalised residual squared per degree of freedom, inliers; 1 if unknown"
    ]
    covariance: Annotated[Array, "144d", "as covariance_kind says, row by row from the first number"]
    status: Annotated[int, "I", "see below"]
    is_keyframe: Annotated[int, "I", "1: this image is the keyframe of those after it"]
    covariance_kind: Annotated[int, "I", "see below"]
    tracked: Annotated[int, "I", "features found again"]
    lost: Annotated[int, "I", "features not found again"]
    fresh: Annotated[int, "I", "features that are new"]
    inliers: Annotated[int, "I", "features that agree with the estimate"]
    zero: Annotated[int, "I", "0"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class KeyframeUpdate:
    """A better pose of a keyframe, in the engine's world. It comes before the estimate of the same image."""

    keyframe_id: Annotated[int, "Q", "its image"]
    world_T_keyframe: Annotated[Array, "16d", "the body there"]
    is_loop_closure: Annotated[int, "I", "1: a place was seen again, 0: refined by what came after"]
    zero: Annotated[int, "I", "0"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Log:
    """A line for the log. It may come at any time."""

    level: Annotated[int, "I", "10 debug, 20 info, 30 warning, 40 error"]
    text: Annotated[bytes, _BYTES, f"UTF-8, at most {MOST_TEXT} bytes"]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Failure:
    """The last message of an engine that gives up, with the reason."""

    text: Annotated[bytes, _BYTES, f"UTF-8, one line, at most {MOST_TEXT} bytes"]


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


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a message.

    Attributes:
        code: as of ``struct``, or ``bytes`` for all up to the end.
        text: what it means.
    """

    name: str
    code: str
    text: str


def fields_of(kind: type[Message]) -> list[Field]:
    """Return the fields of a kind of message, in the order of their bytes."""
    return [Field(name, *hint.__metadata__) for name, hint in get_type_hints(kind, include_extras=True).items()]


class _Layout:
    """How a kind of message lies in bytes."""

    def __init__(self, kind: type[Message]) -> None:
        codes = [(field.name, field.code) for field in fields_of(kind)]
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


def nothing(kind: type[Message]) -> dict[str, Any]:
    """Return values for all fields of a kind that say nothing: zeros, and matrices of poses that are identities."""
    layout = _LAYOUTS[kind]
    values = layout.read(bytes(layout.struct.size))
    return values | {name: np.eye(4).ravel() for name in values if "_T_" in name and len(values[name]) == 16}


class Decoder:
    """Makes messages of the bytes of the other side.

    Args:
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
