# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs with replay records: the filter again over what the autopilot's had, and each estimate beside the log's."""

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from ekf_stub.inputs.inertial import Array
from ekf_stub.log.ekf_log_structure import XKF1, XKF3, XKF4
from viso.compare.agreement import ABSENT, Comparison, Difference
from viso.compare.ekf import targets
from viso.compare.ekf.events import Event, agree, matched, text_events
from viso.compare.ekf.run import LABELS, EkfReplay, EkfRun, NothingToCompare, recorded_firmware, until
from viso.compare.rules import LOG, tolerances_of
from viso.firmware.releases import Firmware
from viso.logs.recorded import read_columns

_RECORD_OF: Final = {
    label: structure.name for structure in (XKF1, XKF3, XKF4) for label in structure.fields if label in LABELS
}
_TOLERANCES: Final = tolerances_of(LOG)


def told_by_log(path: Path) -> Firmware | None:
    """Return the profile of the release that wrote a log. Raises InputError if the log cannot be read."""
    return recorded_firmware(read_columns(path))


def estimate_differences(replay: EkfReplay, core: int = 0) -> Iterator[Difference]:
    """Yield the estimates of a core that differ, and its texts."""
    for label in LABELS:
        field = f"{_RECORD_OF[label]}.{label}"
        tolerance = _TOLERANCES.get(field)
        ours, recorded = replay.ours[label], replay.recorded[label]
        apart = np.abs(ours - recorded)
        if tolerance is not None and tolerance.is_angle:
            apart = np.abs((ours - recorded + 180) % 360 - 180)
        shown, unit = f"{_RECORD_OF[label]}[{core}].{label}", "" if tolerance is None else tolerance.unit
        for index in _beyond(
            apart, 0.0 if tolerance is None else tolerance.within, tolerance is not None and tolerance.is_rms
        ):
            place = f"{replay.time_s[index]:.3f} s"
            yield Difference(place, shown, f"{recorded[index]:.9g}", f"{ours[index]:.9g}", unit)
    yield from text_differences(replay.our_texts, replay.recorded_texts, f"MSG of core {core}")


def _beyond(apart: Array, within: float, is_rms: bool) -> Sequence[int]:
    """Return the records that are too far apart; of a root mean square the one that is furthest."""
    if not is_rms:
        return [int(index) for index in np.flatnonzero(~(apart <= within))]
    return [] if not apart.size or np.sqrt(np.mean(apart**2)) <= within else [int(np.argmax(apart))]


def text_differences(
    ours: Sequence[tuple[float, str]], recorded: Sequence[tuple[float, str]], field: str
) -> Iterator[Difference]:
    """Yield the texts that one side alone has, that have other numbers, or that come at another time."""
    pairs, alone = matched(text_events(ours), text_events(recorded))
    step, within_s = _TOLERANCES["MSG.Message"].within, _TOLERANCES["MSG.TimeUS"].within
    apart = [pair for pair in pairs if not agree(*pair, step, within_s)]
    for mine, theirs in (*alone, *apart):
        place = f"{(theirs or mine or _NEVER).time_s:.3f} s"
        yield Difference(
            place, field, *(ABSENT if one is None else f"{one.text} at {one.time_s:.3f} s" for one in (theirs, mine))
        )


_NEVER: Final = Event(0.0, None, "")


def compare_log(path: Path, firmware: Firmware, named: str, on_progress: Callable[[int, int], None]) -> Comparison:
    """Run the filter over a log and compare.

    Raises NothingToCompare if it has no replay records, or no estimates; InputError if it cannot be read.
    """
    run = EkfRun(path, until_s=targets.end_s(path), firmware=firmware)
    run.run(on_progress)
    found = {core: run.comparison(core) for core in run.imus}
    replays = {core: replay.until(targets.end_s(path)) for core, replay in found.items() if replay is not None}
    if not replays:
        raise NothingToCompare(f"{path}: no XKF records to compare with")
    differences = [one for core, replay in replays.items() for one in estimate_differences(replay, core)]
    our_lanes, lanes = (until(texts, targets.end_s(path)) for texts in (run.our_lanes, run.recorded_lanes))
    notes = [] if targets.end_s(path) == math.inf else [f"compared up to {targets.end_s(path):g} s"]
    if len(replays) < len(run.imus):
        notes.append("not all cores have estimates in it: changes of the primary core are not compared")
        lanes = []
    else:
        differences += text_differences(our_lanes, lanes, "MSG of the lanes")
    records = sum(len(replay.time_s) for replay in replays.values())
    texts = sum(len(replay.recorded_texts) for replay in replays.values()) + len(lanes)
    return Comparison(
        path,
        LOG,
        firmware.name,
        named,
        run.frames,
        records,
        records * len(LABELS) + texts,
        tuple(differences),
        tuple(notes),
    )
