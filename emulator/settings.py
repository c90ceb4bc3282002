# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter values from files and from the command line."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ap_core.param import ParamTable
from ap_core.parm_file import ParmFileError, parse_parm
from ap_visualodom.ap_visualodom import make_params
from emulator.errors import InputError
from emulator.parameters import make_groups
from emulator.text_files import read_text


def _known_parameters(links: int) -> ParamTable:
    return ParamTable(make_groups(links, make_params()))


def load_parm_file(path: Path, table: ParamTable, *, allow_unknown: bool) -> dict[str, float]:
    """Return the values of a .parm file by name.

    Raises:
        InputError: naming file, line and text, for a bad line or, unless allowed, a name that no parameter has.
    """
    text = read_text(path)
    try:
        lines = parse_parm(text, str(path))
    except ParmFileError as error:
        raise InputError(str(error)) from error
    values = {}
    for line in lines:
        if table.find(line.name) is not None:
            values[line.name] = float(line.value)
        elif not allow_unknown:
            raise InputError(
                f"{path}:{line.line_number}: unknown parameter: {line.name!r} (--allow-unknown passes over it)"
            )
    return values


def parse_assignment(text: str, table: ParamTable) -> tuple[str, float]:
    """Return canonical name and value of ``NAME=VALUE``.

    Raises:
        InputError: if it has another form, or no parameter has that name.
    """
    try:
        (line,) = parse_parm(text, "--param")
    except (ParmFileError, ValueError) as error:
        raise InputError(f"--param {text!r}: not NAME=VALUE with a finite number") from error
    found = table.find(line.name)
    if found is None:
        raise InputError(f"--param {text!r}: unknown parameter {line.name}")
    if math.isnan(found.value):
        raise InputError(f"--param {text!r}: {line.name} is a vector: set its _X, _Y or _Z")
    return found.canonical_name, float(line.value)


def load_settings(
    files: Sequence[Path], assignments: Sequence[str], *, links: int, allow_unknown: bool = False
) -> Mapping[str, float]:
    """Return parameter values from defaults files, then from assignments, which win.

    Raises:
        InputError: for anything that cannot be used.
    """
    table = _known_parameters(links)
    values: dict[str, float] = {}
    for path in files:
        values.update(load_parm_file(path, table, allow_unknown=allow_unknown))
    values.update(parse_assignment(text, table) for text in assignments)
    return values
