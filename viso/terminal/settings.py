# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter values from files, presets and the command line, and message intervals from files."""

import logging
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

from ap_core.param import ParamTable
from ap_core.parm_file import ParmFileError, ParmLine, parse_parm
from ap_visualodom.ap_visualodom import make_params
from viso.errors import InputError, as_input_errors
from viso.files.text_files import read_lines, read_text
from viso.firmware.releases import DEFAULT, Firmware
from viso.parameters.conversion import carry_over_from_any, name_here
from viso.parameters.left_out import line_about
from viso.parameters.releases import ALL_RENAMES
from viso.parameters.table import make_groups

_log = logging.getLogger(__name__)

WHOLE_VEHICLE: Final = 200
"""A file of so many parameters was saved by a ground station."""
COMPLETE_GROUP: Final = "VISO_"
"""All names of this group are here, so an unknown one has a line in any file."""
_BETWEEN_WORDS: Final = re.compile(r"[\s,=]+")
_CHOICES: Final = ("VISO_TYPE", "EK3_SRC")
_NAMED: Final = 8


def known_parameters(links: int, firmware: Firmware = DEFAULT) -> ParamTable:
    """Return the parameters of a vehicle with so many links, with their defaults."""
    return ParamTable(make_groups(links, make_params(), firmware.params))


def _hint(name: str, table: ParamTable) -> str:
    if (line := line_about(name)) is not None:
        return f": {line}"
    other = name_here(name, table, ALL_RENAMES)
    return "" if other is None else f", which this firmware calls {other}"


def load_parm_file(
    path: Path, table: ParamTable, *, strict: bool = False, read_only: set[str] | None = None
) -> dict[str, float]:
    """Return the values of a .parm file by name; those that another release calls otherwise are carried over.

    What is carried over is logged. So is each unknown name, in a line each. In a file of 200 parameters or more, as a
    ground station saves it of the whole vehicle, one line counts them, save those of VISO_. Names that ask for what the
    filter here does not do are kept, so that the vehicle can say so.

    Args:
        path: the file.
        table: the parameters of the release.
        strict: whether a name that would have a line is an error.
        read_only: takes the names that the file marks with ``@READONLY``: no client may set them (AP_Param.cpp).

    Raises:
        InputError: names file, line and text of a bad line, or of an unknown name if ``strict``.
    """
    text = read_text(path)
    with as_input_errors(ParmFileError):
        lines = parse_parm(text, str(path))
    if read_only is not None:
        read_only.update(line.name for line in lines if line.read_only)
    numbers = {line.name: line.line_number for line in lines}
    given = {line.name: float(line.value) for line in lines}
    carried = carry_over_from_any(given, table, ALL_RENAMES)
    if carried.conversions:
        _log.warning("%s: of another release: %s", path, first_of([str(one) for one in carried.conversions]))
    if carried.lost:
        _log.warning("%s: for links that are not there: %s", path, first_of(carried.lost))
    unknown = [name for name in carried.values if table.find(name) is None and line_about(name) is None]
    foreign = [name for name in unknown if len(lines) >= WHOLE_VEHICLE and not name.startswith(COMPLETE_GROUP)]
    for name in (name for name in unknown if name not in foreign):
        if strict:
            raise InputError(
                f"{path}:{numbers[name]}: unknown parameter: {name!r} (without --strict it is passed over)"
            )
        _log.warning("%s:%d: unknown parameter, passed over: %s", path, numbers[name], name)
    if foreign:
        _log.warning("%s: without effect here, and passed over: %s", path, first_of(foreign))
    return {name: value for name, value in carried.values.items() if name not in unknown}


def first_of(names: Sequence[str]) -> str:
    """Return the first eight names, and how many others there are: a log holds those of the whole autopilot."""
    others = f" and {len(names) - _NAMED} others" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + others


def read_assignment(text: str, option: str = "--param") -> ParmLine:
    """Return what ``NAME=VALUE`` says, whatever parameters there are. Raises InputError if it has another form."""
    if len(_BETWEEN_WORDS.split(text.strip())) > 2:
        raise InputError(f"{option} {text!r}: not NAME=VALUE but more: give {option} to each")
    try:
        (line,) = parse_parm(text, option)
    except (ParmFileError, ValueError) as error:
        raise InputError(f"{option} {text!r}: not NAME=VALUE with a finite number") from error
    return line


def parse_assignment(text: str, table: ParamTable, option: str = "--param") -> tuple[str, float]:
    """Return canonical name and value of ``NAME=VALUE``.

    Raises InputError, which begins with the option, if it has another form, or no parameter has that name.
    """
    line = read_assignment(text, option)
    found = table.find(line.name)
    if found is None:
        raise InputError(f"{option} {text!r}: unknown parameter {line.name}{_hint(line.name, table)}")
    if math.isnan(found.value):
        raise InputError(f"{option} {text!r}: {line.name} is a vector: set its _X, _Y or _Z")
    return found.canonical_name, float(line.value)


def parse_assignments(
    texts: Sequence[str], option: str, *, links: int, firmware: Firmware = DEFAULT
) -> dict[str, float]:
    """Return the values of several ``NAME=VALUE`` by canonical name; of one name the last counts.

    Raises InputError for the first that cannot be used.
    """
    table = known_parameters(links, firmware)
    return dict(parse_assignment(text, table, option) for text in texts)


def needing_reboot(names: Iterable[str], *, links: int, firmware: Firmware = DEFAULT) -> list[str]:
    """Return those of some parameters that take effect at the next boot only."""
    rows = {slot.name: slot.row for group in known_parameters(links, firmware).groups for slot in group.slots}
    return [name for name in names if name in rows and rows[name].reboot_required]


def load_settings(
    files: Sequence[Path],
    assignments: Sequence[str],
    *,
    links: int,
    strict: bool = False,
    firmware: Firmware = DEFAULT,
    read_only: set[str] | None = None,
) -> Mapping[str, float]:
    """Return parameter values from defaults files, then from assignments, which win.

    ``strict`` makes unknown names in files errors; in assignments they always are. ``read_only`` takes the names that
    files mark so. Raises InputError for anything that cannot be used.
    """
    table = known_parameters(links, firmware)
    values: dict[str, float] = {}
    for path in files:
        values |= load_parm_file(path, table, strict=strict, read_only=read_only)
    values.update(parse_assignment(text, table) for text in assignments)
    for line in _no_such_choices(values, table):
        _log.warning(line)
    return values


def _no_such_choices(values: Mapping[str, float], table: ParamTable) -> Iterator[str]:
    """Yield a line for each parameter that chooses what nothing stands for."""
    for slot in (slot for group in table.groups for slot in group.slots if slot.name.startswith(_CHOICES)):
        value, choices = values.get(slot.name), slot.row.values
        if value is not None and choices and value not in choices:
            known = ", ".join(f"{number} {meaning}" for number, meaning in choices.items())
            yield f"{slot.name} is {value:g}, which is not one of its values: {known}"


STRICT_HELP: Final = "Refuse parameter files with unknown names."

PRESETS: Final[Mapping[str, Path]] = MappingProxyType(
    {path.stem: path for path in sorted((Path(__file__).parent / "preset_files").glob("*.parm"))}
)
"""The files by the names that ``--preset`` takes."""

PRESET_HELP: Final = f"Parameters of a usual set-up, before those of files: {', '.join(PRESETS)}."


def preset_files(name: str | None) -> list[Path]:
    """Return the file of a preset as a list to put other files behind; an empty one for None.

    Raises InputError: there is no preset of that name.
    """
    if name is None:
        return []
    if name not in PRESETS:
        raise InputError(f"--preset {name}: no such preset; there are {', '.join(PRESETS)}")
    return [PRESETS[name]]


def preset_title(path: Path) -> str:
    """Return what a preset's file says it is: the first comment after its header, on one line."""
    comments: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines()[2:]:
        if not line.startswith("#"):
            break
        comments.append(line.removeprefix("#").strip())
    return " ".join(comments)


_MAX_INTERVAL_MS: Final = 65535
_MAX_MESSAGE_ID: Final = (1 << 24) - 1
_MAX_DIGITS: Final = 9


def load_message_intervals(folder: Path, links: int) -> dict[int, Mapping[int, int]]:
    """Return the intervals in ms by message id, for each of the first ``links`` links that has a file in a folder.

    Raises InputError: a file cannot be read, or a line is not an id and an interval.
    """
    paths = {index: folder / f"message-intervals-chan{index}.txt" for index in range(links)}
    return {index: _load(path) for index, path in paths.items() if path.exists()}


def _load(path: Path) -> dict[int, int]:
    intervals_ms = {}
    for number, line in read_lines(path):
        numbers = [int(word) for word in line.split() if _is_number(word)]
        # FIRMWARE PARITY: the firmware skips such a line, or reads it as far as it goes.
        if len(numbers) != len(line.split()) or len(numbers) != 2:
            raise InputError(f"{path}:{number}: not a message id and milliseconds: {line.strip()!r}")
        message_id, interval_ms = numbers
        if message_id > _MAX_MESSAGE_ID or interval_ms > _MAX_INTERVAL_MS:
            raise InputError(f"{path}:{number}: no such message id or interval: {line.strip()!r}")
        intervals_ms[message_id] = interval_ms
    return intervals_ms


def _is_number(word: str) -> bool:
    return word.isascii() and word.isdecimal() and len(word) <= _MAX_DIGITS
