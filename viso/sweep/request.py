# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The request for a sweep, from the command line and from a TOML file."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final

from viso.documents import parsed_toml
from viso.errors import InputError
from viso.files.text_files import read_text
from viso.vehicle.sensors.script.script_file import EXAMPLES

NO_FAULTS: Final = "none"


@dataclass(slots=True)
class SweepRequest:
    """A sweep as it is requested; None for what is not given. Names are those of options, with _ for -."""

    streams: list[Path] = field(default_factory=list)
    set: list[str] = field(default_factory=list)
    sample: str | None = None
    points: int | None = None
    sample_seed: int | None = None
    faults: list[str] | None = None
    seeds: str | None = None
    firmware: list[str] | None = None
    imu: str | None = None
    imu_error: list[str] | None = None
    ahrs: str | None = None
    reference: str | None = None
    preset: str | None = None
    defaults: list[Path] | None = None
    param: list[str] | None = None
    strict: bool | None = None
    baud: int | None = None
    heading: float | None = None
    lead: float | None = None
    until: float | None = None
    message: str | None = None
    format: str | None = None
    topic: str | None = None
    times: Path | None = None
    axes: str | None = None
    rate: float | None = None

    def over(self, other: "SweepRequest") -> "SweepRequest":
        """Return this request, completed by another; ``set`` and ``param`` are joined."""
        merged = SweepRequest()
        for attribute in fields(SweepRequest):
            ours, theirs = getattr(self, attribute.name), getattr(other, attribute.name)
            if attribute.name in ("set", "param"):
                value: Any = [*(theirs or ()), *(ours or ())]
            else:
                value = theirs if ours is None or ours == [] else ours
            setattr(merged, attribute.name, value)
        return merged


# Files

_TEXTS: Final = frozenset({"sample", "imu", "ahrs", "reference", "preset", "message", "format", "topic", "axes"})
_NUMBERS: Final = frozenset({"heading", "lead", "until", "rate"})
_WHOLE: Final = frozenset({"points", "sample_seed", "baud"})
_LISTS: Final = frozenset({"streams", "faults", "firmware", "imu_error", "defaults"})


def read_request(path: Path) -> SweepRequest:
    """Return the request in a TOML file; paths are relative to its folder.

    Raises InputError that names the file and the key.
    """
    try:
        document = parsed_toml(read_text(path))
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    known = {field.name for field in fields(SweepRequest)}
    request = SweepRequest()
    for key, value in document.items():
        if key not in known:
            raise InputError(f"{path}: {key}: no such key here; there are {', '.join(sorted(known))}")
        try:
            setattr(request, key, _value_of(key, value, path.parent))
        except ValueError as error:
            raise InputError(f"{path}: {key}: {error}") from None
    return request


def _value_of(key: str, value: Any, folder: Path) -> Any:
    if key in ("set", "param"):
        return _assignments(value)
    if key == "seeds":
        return _as_text(value)
    if key == "strict":
        return _checked(value, bool, "not true or false")
    if key in _WHOLE:
        return _checked(value, int, "not a whole number")
    if key in _NUMBERS:
        return float(_checked(value, int | float, "not a number"))
    if key in _LISTS:
        texts = _texts(value)
        return texts if key in ("firmware", "imu_error") else [_placed(key, text, folder) for text in texts]
    text = _checked(value, str, "not a text")
    return text if key in _TEXTS - {"imu", "ahrs", "reference"} else _placed(key, text, folder)


def _checked(value: Any, kind: Any, what: str) -> Any:
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise ValueError(what)
    return value


def _texts(value: Any) -> list[str]:
    texts = [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not texts or not all(isinstance(text, str) for text in texts):
        raise ValueError("not a list of texts")
    return texts


def _assignments(value: Any) -> list[str]:
    if not isinstance(value, Mapping):
        raise ValueError("not a table of names and values")
    return [f"{name}={_as_text(entry)}" for name, entry in value.items()]


def _as_text(value: Any) -> str:
    parts = value if isinstance(value, list) else [value]
    if isinstance(value, str):
        return value
    for part in parts:
        _checked(part, int | float, "neither a text such as '0:200:10', nor a number, nor a list of numbers")
    return ",".join(map(str, parts))


def _placed(key: str, text: str, folder: Path) -> Any:
    if key == "imu":
        source, _, argument = text.partition(":")
        return f"{source}:{folder / argument}" if argument and argument not in EXAMPLES else text
    if key == "faults" and text == NO_FAULTS:
        return text
    place = folder / text
    return place if key in ("streams", "defaults", "times") else str(place)
