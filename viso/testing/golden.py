# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Golden logs: records of a run in a text file under version control, against which later runs are held.

A line is a record as JSON: its name under ``record``, then its fields. Floats have the digits that tell them from
their neighbours, so equal lines are equal bits.
"""

import difflib
import json
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from viso.files.outputs import replace_file
from viso.testing.claims import shortened
from viso.testing.observations import Record

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is

UPDATE_OPTION: Final = "--update-golden"
FOLDER: Final = "golden"
DIFF_ROWS: Final = 20

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*", re.ASCII)


@dataclass(frozen=True, slots=True)
class GoldenFiles:
    """The golden files of a test module, and whether this run is to write them."""

    folder: Path
    update: bool

    def check(self, name: str, records: Sequence[Record], leave_out: Collection[str]) -> None:
        """Hold records against the file of a name without its ending, or write it; some labels are left out.

        Raises:
            ValueError: the name is none, there is no record, or no record has a field of a label to be left out.
            AssertionError: the file is missing, or tells something else; the text shows the difference.
        """
        if not _NAME.fullmatch(name):
            raise ValueError(f"golden log {name!r}: a name has letters, digits, '_', '-' and '.'")
        if not records:
            raise ValueError(f"golden log {name!r}: there is no record yet, and an empty log holds nothing")
        unknown = set(leave_out) - {label for record in records for label in record.fields}
        if unknown:
            raise ValueError(f"golden log {name!r}: no record has a field {', '.join(sorted(unknown))}")
        path = self.folder / f"{name}.jsonl"
        lines = [line_of(record, leave_out) for record in records]
        if self.update:
            replace_file(path, "".join(f"{line}\n" for line in lines).encode())
            return
        if not path.exists():
            raise AssertionError(f"there is no golden log {_shown(path)}; pytest {UPDATE_OPTION} writes it")
        difference = list(_difference(path.read_text(encoding="utf-8").splitlines(), lines))
        if difference:
            shown = shortened(difference, DIFF_ROWS)
            raise AssertionError(
                f"the log differs from {_shown(path)} (-), which {UPDATE_OPTION} would rewrite:\n{shown}"
            )


def line_of(record: Record, leave_out: Collection[str]) -> str:
    """Return a record as a line without its end."""
    fields = {label: _plain(value) for label, value in record.fields.items() if label not in leave_out}
    return json.dumps({"record": record.name, **fields})


def _plain(value: object) -> object:
    if isinstance(value, np.floating):
        return float(str(value))
    if isinstance(value, np.integer):
        return int(value)
    return value.decode("latin-1") if isinstance(value, bytes) else value


def _difference(before: Sequence[str], now: Sequence[str]) -> Iterable[str]:
    # The first three lines are names of files and a place in them, which the text tells already.
    return (line for line in difflib.unified_diff(before, now, lineterm="", n=0) if not line.startswith(("---", "+++")))


def _shown(path: Path) -> str:
    return f"{path.parent.parent.name}/{path.parent.name}/{path.name}"
