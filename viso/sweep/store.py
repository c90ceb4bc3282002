# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The folder of a sweep: its definition, a line a point as soon as it is done, and the tables made of them.

A point counts as done once its line is there, whole. Whatever ends the command, the same command goes on from there.
"""

import csv
import fcntl
import io
import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from viso.documents import parsed_json
from viso.errors import InputError, file_errors
from viso.extras import pip_install
from viso.files.outputs import output_file, reading, refuse_input, replace_file
from viso.replay.figures import OBJECTIVES, Row
from viso.sweep.job import Result
from viso.sweep.plan import Point, SweepPlan

DEFINITION: Final = "sweep.json"
JOURNAL: Final = "points.jsonl"
CSV: Final = "results.csv"
PARQUET: Final = "results.parquet"
PLOT: Final = "plot.png"
MISSING_EXTRA: Final = f"-o: tables are written as Parquet with pyarrow; install it with: {pip_install('sweep')}"

_FIRST_COLUMNS: Final = ("point", "stream", "firmware", "faults", "seed")
_TEXT_COLUMNS: Final = frozenset({"stream", "firmware", "faults"})
_COUNTS: Final = frozenset(
    {"point", "seed", "tested", "rejected", "lost", "refused", "resets", "aiding_losses", "ate_poses"}
    | {"messages", "ignored", "dropped", "texts", "warnings"}
)
_ABSENT: Final = object()


class SweepFolder:
    """The folder of a sweep, made if it is not there, and open for one command at a time; use it as a context.

    Attributes:
        done: the figures of the points that are done, by number.

    Raises:
        InputError: it cannot be used, is in use, is another sweep's, or holds an input where a table would go.
    """

    def __init__(self, path: Path, plan: SweepPlan) -> None:
        self.path = path
        self.done: dict[int, Row] = {}
        self._plan = plan
        files = [file.path for recording in plan.recordings for file in (recording.file, *recording.others)]
        with reading(zip(files, files, strict=True)):
            for name in (CSV, PARQUET, PLOT):
                refuse_input(path / name)
        with file_errors(path):
            path.mkdir(parents=True, exist_ok=True)
            self._journal = os.open(path / JOURNAL, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            self._begin()
        except BaseException:
            os.close(self._journal)
            raise

    def _begin(self) -> None:
        try:
            fcntl.flock(self._journal, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise InputError(f"{self.path}: another viso sweep is at work here") from error
        self._check_definition()
        self._read_journal()

    def __enter__(self) -> "SweepFolder":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._journal)

    def _check_definition(self) -> None:
        place, ours = self.path / DEFINITION, json.loads(json.dumps(self._plan.as_dict()))
        try:
            if not place.exists():
                if os.fstat(self._journal).st_size:
                    raise InputError(f"{self.path / JOURNAL}: points of a sweep that nothing defines: no {DEFINITION}")
                replace_file(place, (json.dumps(ours, indent=1) + "\n").encode())
                return
            theirs = parsed_json(place.read_text(encoding="utf-8"))
        except OSError as error:
            raise InputError(f"{place}: {error.strerror or error}") from error
        except ValueError as error:
            raise InputError(f"{place}: not the definition of a sweep: {error}") from error
        different = next(_differences(theirs, ours), None)
        if different is not None:
            raise InputError(f"{place}: another sweep: {different}; -o with another folder begins a new one")

    def _read_journal(self) -> None:
        with open(self._journal, "rb", closefd=False) as file:
            data = file.read()
        whole = data.rfind(b"\n") + 1
        for number, line in enumerate(data[:whole].splitlines(), 1):
            try:
                entry = parsed_json(line.decode())
                self.done.setdefault(int(entry["point"]), dict(entry["figures"]))
            except (ValueError, KeyError, TypeError, OverflowError) as error:
                raise InputError(f"{self.path / JOURNAL}:{number}: not a point of a sweep") from error
        # A line that was being written when the machine went down is done again.
        os.ftruncate(self._journal, whole)
        os.lseek(self._journal, whole, os.SEEK_SET)

    def add(self, result: Result) -> None:
        """Keep the outcome of a point; one without figures is not done, and one that is done stays as it was.

        Raises InputError if it cannot be written.
        """
        if result.row is None or result.number in self.done:
            return
        line = json.dumps({"point": result.number, "figures": result.row}) + "\n"
        with file_errors(self.path / JOURNAL):
            waiting = memoryview(line.encode())
            while waiting:
                waiting = waiting[os.write(self._journal, waiting) :]
        self.done[result.number] = result.row

    def write_tables(self) -> None:
        """Write what is done as CSV and Parquet. Raises InputError if they cannot be written."""
        rows = table_rows(self._plan, self.done)
        for name, data in ((CSV, _as_csv(self._plan, rows)), (PARQUET, _as_parquet(self._plan, rows))):
            with output_file(self.path / name) as file:
                file.write(data)


def _differences(theirs: Any, ours: Any, place: str = "") -> Iterator[str]:
    """Yield where two definitions differ, in words."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for key in dict.fromkeys((*theirs, *ours)):
            yield from _differences(theirs.get(key, _ABSENT), ours.get(key, _ABSENT), f"{place}.{key}".lstrip("."))
    elif theirs != ours:
        before, now = (_shown(value) for value in (theirs, ours))
        yield f"{place} was {before}, now it is {now}"


def _shown(value: Any) -> str:
    if value is _ABSENT:
        return "not there"
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:40]}...{text[-12:]}"


# Tables


def columns(plan: SweepPlan) -> list[str]:
    """Return the names of a table's columns."""
    return [*_FIRST_COLUMNS, *(axis.name for axis in plan.axes), *OBJECTIVES]


def table_rows(plan: SweepPlan, done: Mapping[int, Row]) -> list[dict[str, Any]]:
    """Return the points that are done, with what was changed and their figures, in order."""
    return [{**_changed(plan, point), **done[point.number]} for point in plan.points() if point.number in done]


def _changed(plan: SweepPlan, point: Point) -> dict[str, Any]:
    return {
        "point": point.number,
        "stream": plan.recordings[point.recording].name,
        "firmware": point.firmware,
        "faults": plan.faults[point.faults].name,
        "seed": point.seed,
        **{axis.name: value for axis, value in zip(plan.axes, point.values, strict=True)},
    }


def _as_csv(plan: SweepPlan, rows: list[dict[str, Any]]) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns(plan), extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _as_parquet(plan: SweepPlan, rows: list[dict[str, Any]]) -> bytes:
    import pyarrow as pa
    import pyarrow.parquet as pq

    fields = [(name, _arrow_type(pa, name)) for name in columns(plan)]
    table = pa.table({name: pa.array([row[name] for row in rows], kind) for name, kind in fields})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    data: bytes = sink.getvalue().to_pybytes()
    return data


def _arrow_type(pa: Any, name: str) -> Any:
    if name in _TEXT_COLUMNS:
        return pa.string()
    return pa.int64() if name in _COUNTS else pa.float64()


def check_tables() -> None:
    """Check that tables can be written. Raises InputError if the extra is missing."""
    try:
        import pyarrow.parquet  # noqa: F401
    except ImportError as error:
        raise InputError(MISSING_EXTRA) from error
