# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a log says, and what the filter says over a recorded log beside it."""

import fcntl
import math
import os
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import pytest

from tests.dfreader import read_log
from tests.places import PARITY
from viso.compare.tolerances import BENCH, end_s, tolerances_of
from viso.replay.ekf.run import EkfReplay, EkfRun

SAME_TIME_S: Final = tolerances_of(BENCH)["MSG.TimeUS"].within
"""How far apart an event of ours and the recorded one may be."""

CORE_SAYS: Final = "EKF3 IMU0 "
_ESTIMATES: Final = ("XKF1", "XKF2", "XKF3", "XKF4", "XKF5", "XKFD", "XKFS", "XKQ", "XKV1", "XKV2")
_SAMPLES: Final = ("REPH", "REVH", "RBOH")
_OTHERS: Final = ("MSG", "EV", "ORGN", "RVOH", "REV3")

Row = SimpleNamespace
"""A record: its fields, and ``t``, when it was written (samples: when they came in), in s since boot."""


def log_path(name: str) -> Path:
    """Return the file of a recorded log, whose name stands after that of its release: ``2025-07/voxl``."""
    release, _, stem = name.partition("/")
    return PARITY / release / "logs" / f"{stem}.BIN.xz"


class Log:
    """The records of a log.

    Args:
        path: the file.
        name: what to call it when a test fails.

    Attributes:
        texts: with the time in s.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._name = name
        self._rows: dict[str, list[Row]] = read_log(path, _rows)
        self.texts: list[tuple[float, str]] = [(row.t, row.Message) for row in self.rows("MSG")]

    def __repr__(self) -> str:
        return self._name

    def rows(self, name: str, core: int = 0) -> list[Row]:
        """Return the records of a type, a core's if they have one."""
        return [row for row in self._rows.get(name, []) if getattr(row, "C", core) == core]

    def between(self, name: str, start_s: float, end_s: float = math.inf) -> list[Row]:
        """Return the records of a time, of which there must be some."""
        rows = [row for row in self.rows(name) if start_s <= row.t <= end_s]
        assert rows, f"{self}: no {name} from {start_s} to {end_s} s"
        return rows

    def values(self, name: str, label: str, start_s: float, end_s: float = math.inf) -> list[Any]:
        """Return a field of the records of a time."""
        return [getattr(row, label) for row in self.between(name, start_s, end_s)]

    def at(self, name: str, time_s: float) -> Row:
        """Return the first record from a time on."""
        return self.between(name, time_s)[0]

    def value(self, name: str, label: str, time_s: float) -> Any:
        """Return a field of the first record from a time on."""
        return getattr(self.at(name, time_s), label)

    def first(self, name: str, is_so: Callable[[Any], bool], since_s: float = 0.0) -> float:
        """Return the time of the first record from a time on of which something is so."""
        found = next((row.t for row in self.between(name, since_s) if is_so(row)), None)
        assert found is not None, f"{self}: never in {name} since {since_s} s"
        return float(found)

    def when(self, text: str, since_s: float = 0.0) -> float:
        """Return when the first core said something for the first time; the text need not be whole."""
        found = [time_s for time_s, said in self.texts if time_s >= since_s and said.startswith(CORE_SAYS + text)]
        assert found, f"{self}: never said since {since_s} s: {text}"
        return found[0]

    def said(self, since_s: float = 0.0, until_s: float = math.inf) -> list[str]:
        """Return the texts of the first core, without its name."""
        return [
            said.removeprefix(CORE_SAYS)
            for time_s, said in self.texts
            if said.startswith(CORE_SAYS) and since_s <= time_s <= until_s
        ]


def _rows(log: Any) -> dict[str, list[Row]]:
    rows: dict[str, list[Row]] = {}
    time_s = 0.0
    while (record := log.recv_match(type=[*_ESTIMATES, *_SAMPLES, *_OTHERS])) is not None:
        kind = record.get_type()
        fields = {name: getattr(record, name) for name in record.get_fieldnames()}
        time_s = fields["TimeUS"] / 1e6 if "TimeUS" in fields else time_s
        came_s = fields["TS"] / 1e3 if kind in _SAMPLES else time_s
        rows.setdefault(kind, []).append(Row(t=came_s, **fields))
    return rows


@dataclass(frozen=True)
class Recording:
    """What we say over the inputs of a recorded log, and what the firmware said; the inputs are in ``recorded``."""

    ours: Log
    recorded: Log

    @property
    def both(self) -> tuple[Log, Log]:
        """The logs in which a behaviour is to be seen."""
        return self.ours, self.recorded

    def when(self, find: Callable[[Log], float]) -> float:
        """Return when something happens in the recorded log; ours has it at the same time."""
        ours, recorded = find(self.ours), find(self.recorded)
        assert ours == pytest.approx(recorded, abs=SAME_TIME_S)
        return recorded

    def input(self, name: str, is_so: Callable[[Any], bool], since_s: float = 0.0) -> float:
        """Return when the first sample came, from a time on, of which something is so."""
        return self.recorded.first(name, is_so, since_s)


class Recordings:
    """Runs the filter over recorded logs, which are named after their release: once for each, however many test.

    Args:
        folder: where what comes of it is kept; of all processes of this run.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._replays: dict[str, EkfReplay] = {}
        self._recordings: dict[str, Recording] = {}

    def replay(self, name: str) -> EkfReplay:
        """Return what both say, at the same times."""
        if name not in self._replays:
            self._replays[name] = self._replay(name)
        return self._replays[name]

    def _replay(self, name: str) -> EkfReplay:
        kept = self._ours(name).with_suffix(".pickle")
        with (self._folder / f"{name.replace('/', '_')}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not kept.exists():
                path = log_path(name)
                run = EkfRun(path, until_s=end_s(path))
                run.run()
                run.output.save(self._ours(name))
                kept.write_bytes(pickle.dumps(run.comparison()))
        replay: EkfReplay = pickle.loads(kept.read_bytes())
        return replay

    def _ours(self, name: str) -> Path:
        return self._folder / f"{name.replace('/', '_')}.BIN"

    def __call__(self, name: str) -> Recording:
        """Return both logs."""
        if name not in self._recordings:
            self.replay(name)
            self._recordings[name] = Recording(
                Log(self._ours(name), f"ours over {name}"), Log(log_path(name), f"recorded {name}")
            )
        return self._recordings[name]


def recordings_of_run(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    """Return the recordings of this run of the tests."""
    base = tmp_path_factory.getbasetemp()
    return Recordings(base.parent if "PYTEST_XDIST_WORKER" in os.environ else base)
