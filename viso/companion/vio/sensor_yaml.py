# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``sensor.yaml`` of a camera, as in the EuRoC data sets (Burri et al., 2016).

It is flat but for ``T_BS``, which holds the 16 numbers of a matrix: reading that takes no YAML library.
"""

import re
from types import MappingProxyType
from typing import Any, Final

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
