# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which options name what a command writes; all else that names a file is taken for what it reads, and kept."""

import re
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from os.path import realpath
from pathlib import Path
from typing import Any

from viso.errors import InputError
from viso.files.outputs import check_place, reading, refuse_input


class Output(Enum):
    """Marks an option that names an output; it stands beside ``typer.Option`` in the annotation."""

    FILE = "a file, in a folder that is there"
    PLACE = "a folder, or a file whose folder is made if need be"


def keeping_inputs(command: Any, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return what runs a command that must not write over what it reads.

    Before anything else, places that are none and outputs that are the same file as an input, or as each other, are
    refused with InputError. While the command runs, ``viso.files.outputs`` refuses to write to its inputs by any name.
    ``function`` is of which typer has made the command.
    """
    outputs = {
        name: kind
        for name, annotation in function.__annotations__.items()
        for kind in getattr(annotation, "__metadata__", ())
        if isinstance(kind, Output)
    }
    labels = {parameter.name: _label(parameter) for parameter in command.params}
    inner = command.callback

    def run(**given: Any) -> Any:
        read = [
            named for name, value in given.items() if name not in outputs for named in _files_of(labels[name], value)
        ]
        # Whatever was redirected to standard input is read as well, or will be by whoever comes next.
        with reading([("standard input", 0), *read]):
            _check_outputs({labels[name]: (Path(given[name]), kind) for name, kind in outputs.items() if given[name]})
            return inner(**given)

    return run


def _check_outputs(outputs: Mapping[str, tuple[Path, Output]]) -> None:
    for option, (path, _) in outputs.items():
        refuse_input(path, option)
    options: dict[str, str] = {}
    for option, (path, kind) in outputs.items():
        if kind is Output.FILE and (path.is_file() or not path.exists()):
            other = options.setdefault(realpath(path), option)
            if other != option:
                raise InputError(f"{option} {path}: the same file as {other}")
    for path, kind in outputs.values():
        if kind is Output.FILE:
            check_place(path)


def _label(parameter: Any) -> str:
    """Return what a parameter is called: an option by its long name, an argument by what stands for it in the help."""
    if parameter.param_type_name == "option":
        return str(max(parameter.opts, key=len))
    found = re.search(r"\w[\w.]*\b", parameter.metavar or parameter.name.upper())
    return parameter.name if found is None else found[0]


def _files_of(label: str, value: Any) -> Iterator[tuple[str, str]]:
    """Yield what may be files in a value: all of it, or what follows its kind, as in log:PATH."""
    for one in value if isinstance(value, list | tuple) else (value,):
        if isinstance(one, str | Path):
            text = str(one)
            for path in (text, text.partition(":")[2]):
                yield f"{label} {text}", path
