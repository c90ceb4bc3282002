# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Vectors: calls of AP_VisualOdom, of its maths and of the time correction, recomputed and compared."""

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from viso.compare.comparison import Comparison
from viso.compare.differences import ABSENT, Difference, Row, row_differences
from viso.compare.tolerances import VECTORS
from viso.errors import InputError
from viso.files.text_files import read_lines
from viso.firmware.releases import Firmware
from viso.replay.vectors import VectorError, parse_line, recompute

_UNITS: Final = {"corrected_us": "us"}
_LABELS: Final = {
    "extnav": ["pos", "quat", "posErr", "angErr", "timeStamp_ms", "delay_ms", "resetTime_ms"],
    "extvel": ["vel", "err", "timeStamp_ms", "delay_ms"],
    "odom": ["quality", "delPos", "delAng", "delTime", "timeStamp_ms", "delay_ms", "posOffset"],
    "text": ["severity", "text"],
    "prearm": ["passed", "text"],
    "status": ["enabled", "healthy", "quality"],
    "internal_error": [],
    **{structure.name: list(structure.fields) for structure in LOG_STRUCTURE_FROM_VISUALODOM},
}
"""The labels of each consequence's values."""


Place = tuple[str, list[Row]]
"""The place of a call in its line, and its outputs."""


def _places(line: Any) -> list[Place]:
    """Return the calls of a line."""
    if isinstance(line, list):
        return [("", [Row(str(line[0]), _labelled([""], line[2:]))])]
    if "samples" in line:
        labels = ["corrected_us"]
        return [
            (f", sample {index}", [Row("", _labelled(labels, sample[2:]))])
            for index, sample in enumerate(line["samples"])
        ]
    return [(f", step {index}", _consequences(step)) for index, step in enumerate(line["steps"])]


def _consequences(step: Any) -> list[Row]:
    out = step[-1].get("out") if isinstance(step[-1], dict) else None
    if not isinstance(out, list) or not all(isinstance(consequence, list) and consequence for consequence in out):
        raise VectorError(f"a step without a list of consequences in 'out': {str(step)[:60]}")
    # A record's name is its second word.
    named = (
        [str(consequence[1]), *consequence[2:]] if consequence[0] == "log" and len(consequence) > 1 else consequence
        for consequence in out
    )
    return [Row(str(name), _labelled(_LABELS.get(name, []), values)) for name, *values in named]


def _labelled(labels: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    """Return values by their labels; those without a label by their numbers."""
    named = zip_longest(labels, values, fillvalue=ABSENT)
    return {str(number) if label is ABSENT else label: value for number, (label, value) in enumerate(named)}


def line_differences(number: int, recorded: Any, ours: Any) -> Iterator[Difference]:
    """Yield what differs between a recorded line of vectors and its recomputation; ``number`` counts from 1."""
    for (where, theirs), (_, mine) in zip(_places(recorded), _places(ours), strict=True):
        if theirs != mine:
            yield from row_differences(f"line {number}{where}", theirs, mine, {}, units=_UNITS, names="out")


def compare_vectors(path: Path, firmware: Firmware, on_progress: Callable[[int, int], None]) -> Comparison:
    """Recompute vectors and compare, bit by bit.

    Raises InputError if the file cannot be read, or a line has no known form.
    """
    lines = list(read_lines(path))
    steps = outputs = fields = 0
    differences: list[Difference] = []
    for done, (number, text) in enumerate(lines, 1):
        try:
            recorded = parse_line(text)
            ours: Any = recompute(recorded, firmware.visual_odom)
            differences += line_differences(number, recorded, ours)
        except VectorError as error:
            raise InputError(f"{path}:{number}: {error}") from error
        places = _places(ours)
        rows = [row for _, made in places for row in made]
        steps, outputs = steps + len(places), outputs + len(rows)
        fields += len(ours[2]) if isinstance(ours, list) else sum(max(1, len(row.values)) for row in rows)
        on_progress(done, len(lines))
    return Comparison(path, VECTORS, firmware.name, steps, outputs, fields, tuple(differences))
