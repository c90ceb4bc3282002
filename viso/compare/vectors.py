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

_LABELS: Final = {
    "extnav": ["pos", "quat", "posErr", "angErr", "timeStamp_ms", "delay_ms", "resetTime_ms"],
    "extvel": ["vel", "err", "timeStamp_ms", "delay_ms"],
    "odom": ["quality", "delPos", "delAng", "delTime", "timeStamp_ms", "delay_ms", "posOffset"],
    "text": ["severity", "text"],
    "prearm": ["passed", "text"],
    "status": ["enabled", "healthy", "quality"],
    "internal_error": [],
    **{one.name: list(one.fields) for one in LOG_STRUCTURE_FROM_VISUALODOM},
}
"""The labels of each consequence's values."""


def line_differences(number: int, recorded: Any, ours: Any) -> Iterator[Difference]:
    """Yield what differs between a line of vectors, the number of which is from 1, and the same recomputed."""
    place = f"line {number}"
    if isinstance(recorded, list):
        yield from _differences(place, *([Row(str(one[0]), _labelled([""], one[2:]))] for one in (recorded, ours)))
    elif "samples" in recorded:
        for index, pair in enumerate(zip(recorded["samples"], ours["samples"], strict=True)):
            rows = ([Row("", _labelled(["corrected_us"], one[2:]))] for one in pair)
            yield from _differences(f"{place}, sample {index}", *rows)
    else:
        for index, (theirs, mine) in enumerate(zip(recorded["steps"], ours["steps"], strict=True)):
            if theirs != mine:
                yield from _differences(f"{place}, step {index}", _rows(theirs), _rows(mine))


def _differences(place: str, recorded: Sequence[Row], ours: Sequence[Row]) -> Iterator[Difference]:
    return row_differences(place, recorded, ours, {}, units={"corrected_us": "us"}, names="out")


def _labelled(labels: Sequence[str], values: Sequence[Any]) -> dict[str, Any]:
    """Return values by their labels; those without a label by their numbers."""
    named = zip_longest(labels, values, fillvalue=ABSENT)
    return {str(number) if label is ABSENT else label: value for number, (label, value) in enumerate(named)}


def _rows(step: Any) -> list[Row]:
    out = step[-1].get("out") if isinstance(step[-1], dict) else None
    if not isinstance(out, list) or not all(isinstance(one, list) and one for one in out):
        raise VectorError(f"a step without a list of consequences in 'out': {str(step)[:60]}")
    # A record's name is its second word.
    named = ([str(one[1]), *one[2:]] if one[0] == "log" and len(one) > 1 else one for one in out)
    return [Row(str(name), _labelled(_LABELS.get(name, []), values)) for name, *values in named]


def compare_vectors(path: Path, firmware: Firmware, named: str, on_progress: Callable[[int, int], None]) -> Comparison:
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
        calls, made = _outputs(ours)
        steps, outputs, fields = steps + calls, outputs + len(made), fields + sum(made)
        on_progress(done, len(lines))
    return Comparison(path, VECTORS, firmware.name, named, steps, outputs, fields, tuple(differences))


def _outputs(ours: Any) -> tuple[int, list[int]]:
    """Return how many calls a line holds, and of each output how many fields it has."""
    if isinstance(ours, list):
        return 1, [len(ours[2])]
    if "samples" in ours:
        return len(ours["samples"]), [1] * len(ours["samples"])
    made = [max(1, len(one) - (2 if one[0] == "log" else 1)) for step in ours["steps"] for one in step[-1]["out"]]
    return len(ours["steps"]), made
