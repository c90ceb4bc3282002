# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera of ``viso landmarks``, from a file and from single settings; errors are one line."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from viso.documents import parsed_json, parsed_toml
from viso.errors import InputError
from viso.files.text_files import read_text
from viso.landmarks.inputs.json_lines import JsonReader
from viso.landmarks.types import Camera, CameraInfo

INTRINSICS: Final = ("width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px")
_DEG: Final = "_deg"
KEYS: Final[Mapping[str, str]] = MappingProxyType(
    {field.name.replace("_rad", _DEG): field.name for field in fields(Camera)}
)
"""The names of settings, and the camera's attributes; settings of angles are in degrees."""


def camera_of(file: Path | None, settings: Sequence[str]) -> tuple[Camera, bool]:
    """Return the camera, and whether the user gave its intrinsics.

    Args:
        file: TOML with the names of ``KEYS``, or JSON with K, width and height; None for the defaults.
        settings: ``NAME=VALUE``, with the same names; they override the file.

    Raises:
        InputError: if the file or a setting is invalid; names it.
    """
    values = {} if file is None else _of_file(file)
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals or name not in KEYS:
            raise InputError(f"--set {setting}: not NAME=VALUE with one of {', '.join(KEYS)}")
        try:
            values[KEYS[name]] = _value(name, float(text))
        except ValueError:
            raise InputError(f"--set {setting}: not a number") from None
    try:
        camera = replace(Camera(), **values)
    except ValueError as error:
        raise InputError(f"camera: {error}") from error
    return camera, any(name in values for name in INTRINSICS)


def _value(name: str, value: float) -> Any:
    if name in ("width_px", "height_px"):
        if not value.is_integer():
            raise ValueError(name)
        return int(value)
    return math.radians(value) if name.endswith(_DEG) else value


def _of_file(path: Path) -> dict[str, Any]:
    text = read_text(path)
    if text.lstrip().startswith("{"):
        return _of_camera_info(path, text)
    try:
        table = parsed_toml(text)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    values = {}
    for name, value in table.items():
        if name not in KEYS:
            raise InputError(f"{path}: unknown key {name}; there are {', '.join(KEYS)}")
        try:
            values[KEYS[name]] = _value(name, float(value))
        except (TypeError, ValueError):
            raise InputError(f"{path}: {name}: not a number") from None
    return values


def _of_camera_info(path: Path, text: str) -> dict[str, Any]:
    """Return the intrinsics of a record; an uncalibrated one has none."""
    reader = JsonReader()
    try:
        line = json.dumps(parsed_json(text))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    infos = [event for event in reader.take(line) if isinstance(event, CameraInfo)]
    if not infos:
        raise InputError(f"{path}: {next(iter(reader.refused), 'holds no K, width and height')}")
    return {name: getattr(infos[0], name) for name in INTRINSICS} if infos[0].fx_px else {}
