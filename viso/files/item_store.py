# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Missions, fences and rally points that outlive a restart, in a text file that is always whole.

A line holds an item: its kind (0 mission, 1 fence, 2 rally point), frame, command, param1 to param4, latitude and
longitude in 1e-7 deg, and altitude in m. The first item of a mission is home. The file takes the place of the
firmware's EEPROM.
"""

import logging
import math
import re
from pathlib import Path
from typing import Final

from ap_core.param_info import to_f32
from mav_handlers.transfers.mission_items import MissionItem, MissionType, Plans
from viso.errors import InputError
from viso.files.outputs import remove_stale_drafts, replace_file

_log = logging.getLogger(__name__)

_HEADER: Final = (
    "# Items uploaded over MAVLink, kept over restarts. Rewritten whenever one changes.\n"
    "# kind frame command param1 param2 param3 param4 latitude_e7 longitude_e7 altitude_m\n"
)
_INTEGER: Final = re.compile(r"-?\d{1,10}", re.ASCII)
_FIELDS: Final = 10
_INTEGERS: Final = (0, 1, 2, 7, 8)
_SHOWN_CHARACTERS: Final = 60


class ItemStoreError(InputError):
    """A file of items cannot be used; the text is one line that names the file, and the line at fault."""


class FileItemStore:
    """The file of a vehicle's items.

    Saving replaces the file as a whole. It never raises because of the file system: the first error is logged, further
    ones are not until a save succeeds. The file need not exist; its folder is made when something is saved.

    Attributes:
        failure: why the last save failed, in one line naming the file; None while all is well.

    Raises:
        ItemStoreError: the file cannot be read, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._saved = self._read()
        self._synced = True
        self.failure: str | None = None
        remove_stale_drafts(path)

    def load(self) -> Plans:
        """Return what is stored."""
        return self._saved

    def save_if_changed(self, plans: Plans, *, synced: bool = True) -> bool:
        """Write the file if it is to hold anything else than before, or is to be synced and was not."""
        wanted = {kind: tuple(items) for kind, items in plans.items() if items}
        if wanted == self._saved and (self._synced or not synced):
            return False
        try:
            replace_file(self._path, _format(wanted).encode("ascii"), synced=synced)
        except OSError as error:
            was_reported = self.failure is not None
            self.failure = f"{self._path}: missions cannot be stored: {error.strerror or error}"
            if not was_reported:
                _log.error("%s", self.failure)
            return False
        self._saved, self._synced, self.failure = wanted, synced, None
        return True

    def _read(self) -> dict[MissionType, tuple[MissionItem, ...]]:
        try:
            text = self._path.read_bytes().decode("ascii")
        except FileNotFoundError:
            return {}
        except OSError as error:
            raise ItemStoreError(f"{self._path}: {error.strerror or error}") from error
        except UnicodeDecodeError as error:
            raise ItemStoreError(f"{self._path}: not a text of missions") from error
        found: dict[MissionType, tuple[MissionItem, ...]] = {}
        for number, line in enumerate(text.split("\n"), 1):
            words = line.split("#", 1)[0].split()
            if words:
                parsed = _parsed(words)
                if parsed is None:
                    raise ItemStoreError(f"{self._path}:{number}: not an item: {line[:_SHOWN_CHARACTERS]!r}")
                kind, item = parsed
                found[kind] = (*found.get(kind, ()), item)
        return found


def _parsed(words: list[str]) -> tuple[MissionType, MissionItem] | None:
    if len(words) != _FIELDS or not all(_INTEGER.fullmatch(words[index]) for index in _INTEGERS):
        return None
    kind, frame, command, x, y = (int(words[index]) for index in _INTEGERS)
    try:
        first, second, third, fourth, z = (float(to_f32(float(words[index]))) for index in (3, 4, 5, 6, 9))
    except ValueError:
        return None
    is_finite = all(map(math.isfinite, (first, second, third, fourth, z)))
    if not is_finite or kind not in list(MissionType) or max(abs(x), abs(y)) >= 1 << 31:
        return None
    return MissionType(kind), MissionItem(command, frame, (first, second, third, fourth), x, y, z)


def _format(plans: Plans) -> str:
    lines = (
        " ".join((str(int(kind)), str(item.frame), str(item.command), *_texts(item), repr(item.z)))
        for kind, items in sorted(plans.items())
        for item in items
    )
    return _HEADER + "".join(f"{line}\n" for line in lines)


def _texts(item: MissionItem) -> tuple[str, ...]:
    return (*map(repr, item.params), str(item.x), str(item.y))
