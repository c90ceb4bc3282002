# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The configuration of visual-inertial odometry: the section ``vio`` of a TOML file, its ranges and defaults."""

import dataclasses
import enum
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

from viso.documents import parsed_toml

_T = TypeVar("_T")

Scalar = bool | int | float | str
"""The type of an option of an engine."""


class ConfigError(ValueError):
    """A configuration that cannot be used; its text is one line ``file: key: what``."""


class Scene(enum.StrEnum):
    """What the camera looks at."""

    GENERAL = "general"
    PLANAR = "planar"
    AUTO = "auto"


class AglSource(enum.StrEnum):
    """Where the height above ground comes from."""

    RANGEFINDER = "rangefinder"
    BARO = "baro"
    NONE = "none"


class CovarianceEncoding(enum.StrEnum):
    """What the covariances of ODOMETRY hold: variances, or what makes ArduPilot up to 4.6 compute their roots."""

    VARIANCE = "variance"
    ARDUPILOT_ERROR = "ardupilot_error"


class LocalAlignment(enum.StrEnum):
    """Where x of the local frame points."""

    NORTH = "north"
    HEADING0 = "heading0"


def _within(default: float, low: float, high: float) -> Any:
    """Return a field for numbers from ``low`` to ``high``, both included."""
    return dataclasses.field(default=default, metadata={"range": (low, high)})


class _Section:
    """A table whose fields are checked, by their types and ranges, when it is made."""

    __slots__ = ()

    def __post_init__(self) -> None:
        for field in dataclasses.fields(cast(Any, self)):
            object.__setattr__(self, field.name, _checked(field, getattr(self, field.name)))


def _checked(field: "dataclasses.Field[Any]", value: Any) -> Any:
    if "options" in field.metadata:
        return _scalars(field.name, value)
    kind: Any = field.type
    if issubclass(kind, enum.StrEnum):
        if value not in list(kind):
            raise ValueError(f"{field.name}: {value!r} is none of {', '.join(kind)}")
        return kind(value)
    if kind is float and type(value) is int:
        value = float(value)
    if type(value) is not kind:
        raise ValueError(f"{field.name}: {value!r} is no {kind.__name__}")
    low, high = field.metadata.get("range", (None, None))
    if low is not None and not low <= value <= high:
        raise ValueError(f"{field.name}: {value!r} is not within {low:g} to {high:g}")
    return value


def _scalars(name: str, value: Any) -> dict[str, Scalar]:
    if not isinstance(value, Mapping):
        raise ValueError(f"{name}: not a table")
    for key, scalar in value.items():
        if not isinstance(key, str) or type(scalar) not in (bool, int, float, str):
            raise ValueError(f"{name}.{key}: neither a number nor a text nor true or false")
    return dict(value)


def _read(kind: type[_T], table: Any, path: str) -> _T:
    """Return the section of a TOML table; keys that are missing have their defaults.

    Raises ConfigError: ``key: what`` for a key that is unknown or a value that cannot be used.
    """
    if not isinstance(table, Mapping):
        raise ConfigError(f"{path}: not a table")
    fields = {field.name: field for field in dataclasses.fields(cast(Any, kind))}
    values = {}
    for key, value in table.items():
        if key not in fields:
            raise ConfigError(f"{path}.{key}: unknown key")
        inner: Any = fields[key].type
        if dataclasses.is_dataclass(inner):
            value = _read(cast(Any, inner), value, f"{path}.{key}")
        values[key] = value
    try:
        return kind(**{key: _checked(fields[key], value) for key, value in values.items()})
    except ValueError as error:
        raise ConfigError(f"{path}.{error}") from error


@dataclass(frozen=True, slots=True)
class ImuNoise:
    """The four densities of an IMU's noise, the same for all axes.

    Attributes:
        gyro: white noise of the rotation rate in rad/s/sqrt(Hz).
        accel: white noise of the specific force in m/s^2/sqrt(Hz).
        gyro_walk: random walk of the gyro bias in rad/s^2/sqrt(Hz).
        accel_walk: random walk of the accelerometer bias in m/s^3/sqrt(Hz).

    Raises:
        ValueError: if one is not positive and finite; names the field.
    """

    gyro: float = 1.7e-3
    accel: float = 2e-2
    gyro_walk: float = 2e-5
    accel_walk: float = 1e-3

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            density = getattr(self, field.name)
            if not (density > 0 and math.isfinite(density)):
                raise ValueError(f"{field.name}: not positive and finite")


@dataclass(frozen=True, slots=True)
class LostPolicy(_Section):
    """What is sent when the pose is lost.

    Attributes:
        send_s: how long a LOST odometry repeats the last pose with quality -1 before it is silent.
    """

    send_s: float = _within(3.0, 0.0, 60.0)


@dataclass(frozen=True, slots=True)
class OdometryConfig(_Section):
    """The section ``vio.odometry``: what goes to the autopilot.

    Attributes:
        rate_hz: messages per second.
        covariance_encoding: contents of their covariances.
        local_alignment: where x of the local frame points.
        lost_policy: what is sent when the pose is lost.
        system_id, component_id: MAVLink id of the sender.
    """

    rate_hz: float = _within(20.0, 4.0, 200.0)
    covariance_encoding: CovarianceEncoding = CovarianceEncoding.VARIANCE
    local_alignment: LocalAlignment = LocalAlignment.NORTH
    lost_policy: LostPolicy = LostPolicy()
    system_id: int = _within(1, 1, 255)
    component_id: int = _within(197, 1, 255)


@dataclass(frozen=True, slots=True)
class QueueConfig(_Section):
    """The section ``vio.queue``.

    Attributes:
        depth: full-size frames that may wait for the worker.
    """

    depth: int = _within(1, 1, 16)


@dataclass(frozen=True, slots=True)
class EngineConfig(_Section):
    """The section ``vio.engine``: how an engine, such as ``okvis2``, is run, and how far it is believed.

    Attributes:
        command: starts the engine's program, as in a shell; empty for none.
        start_timeout_s: how long the program may take to start.
        frame_timeout_s: how long the program may take for a frame before viso restarts it.
        mask: file of a picture that is 0 where the camera's pictures must not be used; for programs that take one.
        covariance_scale: factor for the engine's covariances.
        drift_rad: without covariances: sigma of the rotation 1 s after the keyframe, growing as the root of time.
        drift_m: without covariances: sigma of the position 1 s after the keyframe, growing as the root of time.
        drift_share: without covariances: sigma of the position as a share of the distance from the keyframe.
    """

    command: str = ""
    start_timeout_s: float = _within(10.0, 0.1, 600.0)
    frame_timeout_s: float = _within(1.0, 0.01, 60.0)
    mask: str = ""
    covariance_scale: float = _within(1.0, 1e-6, 1e6)
    drift_rad: float = _within(0.005, 1e-6, 1.0)
    drift_m: float = _within(0.02, 1e-6, 100.0)
    drift_share: float = _within(0.02, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class VioConfig(_Section):
    """The section ``vio``.

    Attributes:
        strategy: name of the strategy.
        working_width_px: largest width of processed images; larger ones are shrunk.
        max_features: most features that are tracked at a time.
        fb_threshold_px: largest forward-backward error of a track.
        ransac_threshold_px: threshold of the geometric check.
        min_tracked: a frame with fewer inliers is DEGRADED.
        lost_frames_fatal: consecutive frames without a result that lead to LOST.
        degraded_inflation: factor of the sent covariance in DEGRADED.
        max_position_sigma_m: a position with a larger sigma is DEGRADED.
        max_velocity_sigma_m_s: a velocity with a larger sigma is DEGRADED.
        auto_reinit_s: time from LOST to INIT without a warm start; 0 for never.
        scene: what the camera looks at.
        agl_source: source of the height above ground.
        agl_sigma_m: smallest sigma of the height.
        agl_scale_sigma: sigma of the scale that a wrong height causes, as a share.
        ground_z_m: height of the plane in the world (ENU).
        window_clones: poses in the filter's window.
        clahe: whether contrast is equalised.
        seed: seed of all random numbers.
        threads: threads of the libraries for pictures and for linear algebra.
        imu_noise: densities of the IMU's noise.
        odometry: what goes to the autopilot.
        queue: between camera and worker.
        engine: how an engine is run, and how far it is believed.
        native: an engine's own options, passed on unchanged; see its documentation.
    """

    strategy: str = "klt_ransac"
    working_width_px: int = _within(1400, 64, 8192)
    max_features: int = _within(180, 8, 5000)
    fb_threshold_px: float = _within(0.7, 0.01, 10.0)
    ransac_threshold_px: float = _within(1.0, 0.01, 10.0)
    min_tracked: int = _within(30, 8, 5000)
    lost_frames_fatal: int = _within(9, 1, 10_000)
    degraded_inflation: float = _within(4.0, 1.0, 1e6)
    max_position_sigma_m: float = _within(20.0, 0.1, 1e6)
    max_velocity_sigma_m_s: float = _within(1.0, 0.01, 1e3)
    auto_reinit_s: float = _within(0.0, 0.0, 3600.0)
    scene: Scene = Scene.AUTO
    agl_source: AglSource = AglSource.NONE
    agl_sigma_m: float = _within(0.3, 1e-3, 100.0)
    agl_scale_sigma: float = _within(0.02, 0.0, 0.5)
    ground_z_m: float = _within(0.0, -20_000.0, 20_000.0)
    window_clones: int = _within(11, 2, 100)
    clahe: bool = False
    seed: int = _within(0, 0, 2**31 - 1)
    threads: int = _within(1, 1, 256)
    imu_noise: ImuNoise = dataclasses.field(default_factory=ImuNoise)
    odometry: OdometryConfig = OdometryConfig()
    queue: QueueConfig = QueueConfig()
    engine: EngineConfig = EngineConfig()
    native: dict[str, Scalar] = dataclasses.field(default_factory=dict, hash=False, metadata={"options": True})

    def __post_init__(self) -> None:
        _Section.__post_init__(self)  # slots replace the class, so the short form of super() would not find it
        if self.min_tracked > self.max_features:
            raise ValueError(f"min_tracked: {self.min_tracked} is more than max_features ({self.max_features})")

    @property
    def scale_sigma(self) -> float:
        """Sigma of the scale, as a share: none where no height makes it."""
        return 0.0 if self.agl_source is AglSource.NONE else self.agl_scale_sigma

    def effective(self) -> dict[str, Any]:
        """Return all values, defaults included, as TOML tables would hold them."""
        return dataclasses.asdict(self)

    def digest(self) -> str:
        """Return the SHA-256 of the values as JSON, hexadecimal."""
        return hashlib.sha256(json.dumps(self.effective(), sort_keys=True).encode()).hexdigest()


def config_from_table(tables: Mapping[str, Any], file: str) -> VioConfig:
    """Return the configuration of parsed TOML.

    Args:
        tables: all of the file; ``vio`` is the only table that it may have.
        file: its name, for the error.

    Raises:
        ConfigError: naming file and key.
    """
    try:
        for key in tables.keys() - {"vio"}:
            raise ConfigError(f"{key}: unknown key")
        return _read(VioConfig, tables.get("vio", {}), "vio")
    except ConfigError as error:
        raise ConfigError(f"{file}: {error}") from error


def config_from_text(text: str, file: str) -> VioConfig:
    """Return the configuration of TOML text. Raises ConfigError, naming file, and key or line."""
    try:
        tables = parsed_toml(text)
    except ValueError as error:
        raise ConfigError(f"{file}: {error}") from error
    return config_from_table(tables, file)


def load_config(path: Path) -> VioConfig:
    """Return the configuration in a TOML file. Raises ConfigError, naming file, and key or line."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: not UTF-8 text") from error
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror or error}") from error
    return config_from_text(text, str(path))
