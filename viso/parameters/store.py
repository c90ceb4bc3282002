# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameters that outlive a restart, in memory or in a text file that a killed process leaves as it was or complete.

The file has a ``NAME VALUE`` line a parameter, as parameter files have, and ``#`` comments. It takes the place of the
firmware's EEPROM and holds what AP_Param::save wrote: values that differ from the default or were set once.
"""

import logging
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Protocol

from ap_core.param import ParamTable
from ap_core.param_info import ParamType, assigned, to_f32
from viso.errors import InputError
from viso.files.outputs import remove_stale_drafts, replace_file
from viso.parameters.conversion import NO_RENAMES, Renames, carry_over


class StoredParams(Protocol):
    """A place that keeps parameters over a restart."""

    def restore(self, params: ParamTable, renames: Renames = NO_RENAMES) -> None:
        """Set a vehicle's parameters to their stored values, which an earlier release may have stored."""

    def save_if_changed(self, values: Mapping[str, float], *, synced: bool = True) -> bool:
        """Store the values of parameters by name; return whether any value was new.

        ``synced``: so that they survive a restart of the computer, which takes longer.
        """


class MemoryParamStore:
    """Keeps parameters in memory."""

    def __init__(self) -> None:
        self._values: dict[str, float] = {}

    def restore(self, params: ParamTable, renames: Renames = NO_RENAMES) -> None:
        """Set a vehicle's parameters to their stored values, which an earlier release may have stored."""
        params.load_stored(carry_over(self._values, params, renames).values)

    def save_if_changed(self, values: Mapping[str, float], *, synced: bool = True) -> bool:
        """Store the values of parameters by name; return whether any value was new."""
        changed = values != self._values
        self._values = dict(values)
        return changed


_log = logging.getLogger(__name__)

_HEADER: Final = "# Parameters set over MAVLink, kept over restarts. Rewritten whenever one changes.\n"
_NAME: Final = re.compile(r"[A-Za-z0-9_]{1,16}", re.ASCII)
_INTEGER: Final = re.compile(r"[+-]?\d{1,10}", re.ASCII)
_DECIMAL: Final = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_SHOWN_CHARACTERS: Final = 60


class ParamStoreError(InputError):
    """A file of parameters cannot be used; the text is one line that names the file, and the line at fault."""


class ParamStore:
    """The file of a vehicle's stored parameters.

    ``load`` or ``restore`` comes first, ``save_if_changed`` then as often as one likes. Saving replaces the file as a
    whole, so of several processes the last one wins. Saving never raises because of the file system: the first error
    is logged, further ones are not until a save succeeds.

    Args:
        path: the file, which need not exist; its folder is made when something is saved.

    Attributes:
        unknown: parameters in the file that the vehicle does not have; they are kept there.
        failure: why the last save failed, in one line naming the file; None while all is well.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._saved: dict[str, float] | None = None
        self._synced = True
        self.unknown: dict[str, float] = {}
        self.failure: str | None = None

    def load(self) -> dict[str, float]:
        """Return the stored values by name, integers as int, all else as float; none when there is no file.

        Raises ParamStoreError if the file cannot be read or is damaged.
        """
        return self._loaded(self._read())

    def _loaded(self, found: Mapping[str, tuple[float, int]]) -> dict[str, float]:
        self._saved = {name: value for name, (value, _) in found.items()}
        self.unknown = {}
        remove_stale_drafts(self._path)
        return dict(self._saved)

    def restore(self, params: ParamTable, renames: Renames = NO_RENAMES) -> None:
        """Give a vehicle's parameters their stored values; names it does not know are logged, and kept in the file.

        What an earlier release has stored under another name is carried over, and kept under the old name as well.
        Raises ParamStoreError if the file cannot be read, is damaged, or has a value that its parameter cannot take.
        """
        found = self._read()
        for name, (value, line_number) in found.items():
            param = params.find(name)
            if param is not None and param.canonical_name == name and not _fits(value, param.type):
                raise ParamStoreError(f"{self._path}:{line_number}: {name} cannot be {value}")
        values = self._loaded(found)
        unknown = params.load_stored(carry_over(values, params, renames).values)
        old = {name for name in values if name in renames and params.find(name) is None}
        self.unknown = {name: value for name, value in values.items() if name in unknown or name in old}
        if unknown:
            _log.warning("%s: unknown parameters, kept in the file: %s", self._path, ", ".join(unknown))

    def save_if_changed(self, values: Mapping[str, float], *, synced: bool = True) -> bool:
        """Write the file if it is to hold anything else than at the last load or save; say whether it was written.

        A file that somebody has deleted is rewritten, and so is one that is to be synced and was not.

        Args:
            values: what a restart has to remember, by name: int, or what fits float32. Unknown names are added.
            synced: whether to wait for the disk, so that the values outlive not this process alone but the computer.

        Raises:
            ValueError: nothing was loaded yet, which would lose what is stored; or a name or value that no file
                can hold.
        """
        if self._saved is None:
            raise ValueError(f"{self._path}: load comes before save")
        wanted = {**self.unknown, **values}
        is_there = self._path.exists() or not wanted
        if wanted == self._saved and is_there and (self._synced or not synced):
            return False
        data = _format(wanted).encode("ascii")
        try:
            replace_file(self._path, data, synced=synced)
        except OSError as error:
            self._fail(error)
            return False
        self._saved = wanted
        self._synced = synced
        self.failure = None
        return True

    def _fail(self, error: OSError) -> None:
        was_reported = self.failure is not None
        self.failure = f"{self._path}: parameters cannot be stored: {error.strerror or error}"
        if not was_reported:
            _log.error("%s", self.failure)

    def _read(self) -> dict[str, tuple[float, int]]:
        try:
            data = self._path.read_bytes()
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise ParamStoreError(f"{self._path}: {error.strerror or error}") from error
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            number = data.count(b"\n", 0, error.start) + 1
            raise ParamStoreError(f"{self._path}:{number}: not UTF-8 text") from error
        # Every file of ours has a comment; an empty one is what a crash of the computer can leave of another.
        if not text.strip():
            raise ParamStoreError(f"{self._path}:1: the file is empty")
        return self._parse(text)

    def _parse(self, text: str) -> dict[str, tuple[float, int]]:
        found: dict[str, tuple[float, int]] = {}
        for number, line in enumerate(text.split("\n"), 1):
            words = line.split("#", 1)[0].split()
            if not words:
                continue
            name, value = words[0], _number(words[1]) if len(words) == 2 else None
            if value is None or not _NAME.fullmatch(name):
                raise ParamStoreError(f"{self._path}:{number}: not a name and a number: {line[:_SHOWN_CHARACTERS]!r}")
            if name in found:
                raise ParamStoreError(f"{self._path}:{number}: {name} is in line {found[name][1]} already")
            found[name] = (value, number)
        return found


def _number(word: str) -> float | None:
    if _INTEGER.fullmatch(word):
        return int(word)
    number = float(to_f32(float(word))) if _DECIMAL.fullmatch(word) else math.nan
    return number if math.isfinite(number) else None


def _fits(value: float, kind: ParamType) -> bool:
    return kind is ParamType.FLOAT or assigned(value, kind) == value


def _format(values: Mapping[str, float]) -> str:
    return _HEADER + "".join(f"{_checked(name):<16} {_text(values[name])}\n" for name in sorted(values))


def _checked(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise ValueError(f"{name!r} cannot be the name of a stored parameter")
    return name


def _text(value: float) -> str:
    if isinstance(value, int):
        if not _INTEGER.fullmatch(str(value)):
            raise ValueError(f"{value} cannot be stored as a parameter")
        return str(value)
    number = to_f32(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} cannot be stored as a parameter")
    # The second one is always exact: a short text may change when it passes through double precision.
    return next(text for text in (str(number), repr(float(number))) if to_f32(float(text)) == number)
