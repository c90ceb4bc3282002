# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Calibrations of cameras, from files.

A file of our own is TOML; its keys are the fields of :class:`~viso.companion.vio.types.CameraCalibration`::

    camera_id = "nav"
    unit = "07"
    width = 5472
    height = 3648
    fx = 7200.0
    fy = 7200.0
    cx = 2735.5
    cy = 1823.5
    distortion_model = "radtan"             # or "equidistant"; left out: "none"
    distortion = [-0.02, 0.01, 0.0, 0.0]
    mounting = "nadir"                      # or "forward"; or B_T_C, four rows of four numbers
    position_m = [0.1, 0.0, -0.05]          # of the camera in the body; left out: the body's origin
    time_offset_s = 0.0
    rotation_sigma_rad = 0.01               # and so on: all that follows in the fields may be left out

A ``sensor.yaml`` as in the EuRoC data sets is read as well. It names no camera: ``camera_id`` is then the name of the
file without its suffix, ``unit`` is "0".
"""

import dataclasses
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from viso.companion.vio.frames import MOUNTINGS
from viso.companion.vio.types import CameraCalibration, DistortionModel
from viso.documents import parsed_toml
from viso.geometry.pose import SE3
from viso.geometry.rotation import Array


class CalibrationError(ValueError):
    """A file is no calibration; the text is one line, ``file: field: what``."""


def load_calibration(path: Path) -> CameraCalibration:
    """Return the calibration in a ``.toml`` file of our own or in a ``.yaml`` file as EuRoC's.

    Raises CalibrationError if the file cannot be read, lacks a field, or has one that is unknown or wrong.
    """
    try:
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".toml":
            return _calibration(parsed_toml(text))
        if path.suffix in (".yaml", ".yml"):
            return _calibration(sensor_values(text, path.stem))
        raise ValueError("neither .toml nor .yaml")
    except OSError as error:
        raise CalibrationError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise CalibrationError(f"{path}: {error}") from error


def scaled(calibration: CameraCalibration, divisor: int) -> CameraCalibration:
    """Return the calibration of the same camera's picture, each ``divisor`` x ``divisor`` pixels averaged to one.

    The first pixel's middle is (0, 0), so its corner is what scaling leaves in place: ``c' = (c + 0.5) / s - 0.5``.
    Columns and rows that fill no whole block are to be cut off before.

    Raises:
        ValueError: if the divisor is not from 1 to the smaller side of the picture.
    """
    if not 1 <= divisor <= min(calibration.width, calibration.height):
        raise ValueError("divisor: leaves no pixel")
    return dataclasses.replace(
        calibration,
        width=calibration.width // divisor,
        height=calibration.height // divisor,
        fx=calibration.fx / divisor,
        fy=calibration.fy / divisor,
        cx=(calibration.cx + 0.5) / divisor - 0.5,
        cy=(calibration.cy + 0.5) / divisor - 0.5,
        line_time_s=calibration.line_time_s * divisor,
    )


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError("not a text")
    return value


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("not a number")
    return float(value)


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError("not a whole number")
    return value


def _numbers(value: Any) -> list[float]:
    if not isinstance(value, list):
        raise ValueError("not a list of numbers")
    return [_number(item) for item in value]


def _position(value: Any) -> list[float]:
    if len(_numbers(value)) != 3:
        raise ValueError("not three numbers")
    return _numbers(value)


def _motion(value: Any) -> SE3:
    if not isinstance(value, list) or [len(_numbers(row)) for row in value] != [4] * 4:
        raise ValueError("not four rows of four numbers")
    return SE3.from_matrix(value)


def _mounting(value: Any) -> Array:
    if _text(value) not in MOUNTINGS:
        raise ValueError(f"{value!r} is none of {', '.join(MOUNTINGS)}")
    return MOUNTINGS[value]


_PARSERS: Final[Mapping[str, Callable[[Any], Any]]] = MappingProxyType(
    {
        "camera_id": _text,
        "unit": _text,
        "width": _whole,
        "height": _whole,
        **{field.name: _number for field in dataclasses.fields(CameraCalibration) if field.type is float},
        "distortion_model": _text,
        "distortion": _numbers,
        "B_T_C": _motion,
        "mounting": _mounting,
        "position_m": _position,
    }
)
_REQUIRED: Final = ("camera_id", "unit", "width", "height", "fx", "fy", "cx", "cy")


def _calibration(values: Mapping[str, Any]) -> CameraCalibration:
    fields = {key: _parsed(key, value) for key, value in values.items()}
    for key in _REQUIRED:
        if key not in fields:
            raise ValueError(f"{key}: missing")
    if "B_T_C" not in fields:
        if "mounting" not in fields:
            raise ValueError("B_T_C: missing, and so is mounting")
        fields["B_T_C"] = SE3(fields.pop("mounting"), fields.pop("position_m", [0.0, 0.0, 0.0]))
    for key in ("mounting", "position_m"):
        if key in fields:
            raise ValueError(f"{key}: not beside B_T_C")
    return CameraCalibration(**{"distortion_model": DistortionModel.NONE, "distortion": [], **fields})


def _parsed(key: str, value: Any) -> Any:
    if key not in _PARSERS:
        raise ValueError(f"{key}: unknown")
    try:
        return _PARSERS[key](value)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from error


_MODELS: Final = MappingProxyType(
    {"radial-tangential": "radtan", "radtan": "radtan", "equidistant": "equidistant", "none": "none"}
)
_LISTS: Final[MappingProxyType[str, tuple[type[int] | type[float], int | None]]] = MappingProxyType(
    {
        "data": (float, 16),
        "resolution": (int, 2),
        "intrinsics": (float, 4),
        "distortion_coefficients": (float, None),
    }
)
_TEXTS: Final = ("camera_model", "distortion_model")
_IGNORED: Final = ("sensor_type", "comment", "T_BS", "rows", "cols", "rate_hz")

_COMMENT_OR_HEADER: Final = re.compile(r"#.*|^%.*|^---", re.MULTILINE)
# A key with a list, which may go over several lines, or with the rest of its line.
_FIELD: Final = re.compile(r"^[ \t]*(\w+):[ \t]*(\[[^\]]*\]|[^\[\n]*?)[ \t]*$", re.MULTILINE)


def sensor_values(text: str, camera_id: str) -> dict[str, Any]:
    """Return what a sensor.yaml says, by the keys of our own calibration files.

    Args:
        text: of the file.
        camera_id: what to call the camera; the file does not say.

    Raises:
        ValueError: if a field is missing, unknown or wrong; names it.
    """
    fields = _fields(text)
    lists = {key: _list(key, fields[key]) for key in _LISTS}
    width, height = lists["resolution"]
    fx, fy, cx, cy = lists["intrinsics"]
    return {
        "camera_id": camera_id,
        "unit": "0",
        "width": width,
        "height": height,
        "fx": fx,
        "fy": fy,
        "cx": cx,
        "cy": cy,
        "distortion_model": _MODELS[fields["distortion_model"]],
        "distortion": lists["distortion_coefficients"],
        "B_T_C": [lists["data"][start : start + 4] for start in (0, 4, 8, 12)],
    }


def _fields(text: str) -> dict[str, str]:
    bare = _COMMENT_OR_HEADER.sub("", text)
    rest = _FIELD.sub("", bare).strip()
    if rest:
        raise ValueError(f"{rest.splitlines()[0].strip()!r}: not understood")
    fields = {key: value.strip("'\"") for key, value in _FIELD.findall(bare)}
    for key in fields:
        if key not in (*_LISTS, *_TEXTS, *_IGNORED):
            raise ValueError(f"{key}: unknown")
    for key in (*_LISTS, *_TEXTS):
        if key not in fields:
            raise ValueError(f"{key}: missing")
    if fields["camera_model"] != "pinhole":
        raise ValueError(f"camera_model: {fields['camera_model']!r}, not pinhole")
    if fields["distortion_model"] not in _MODELS:
        raise ValueError(f"distortion_model: {fields['distortion_model']!r} is none of {', '.join(_MODELS)}")
    return fields


def _list(key: str, text: str) -> list[float]:
    kind, count = _LISTS[key]
    try:
        numbers: list[float] = [kind(item) for item in text.strip("[]").split(",") if item.strip()]
    except ValueError:
        raise ValueError(f"{key}: not a list of numbers") from None
    if count is not None and len(numbers) != count:
        raise ValueError(f"{key}: {len(numbers)} numbers, not {count}")
    return numbers
