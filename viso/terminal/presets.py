# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Parameter files for the set-ups that people use, by name; each gives the reason for every value."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from viso.errors import InputError

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
