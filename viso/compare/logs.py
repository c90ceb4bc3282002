# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs with replay records: the filter runs over the inputs; its estimates are compared with the log's."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path

from viso.compare.comparison import Comparison
from viso.compare.differences import Difference, column_differences
from viso.compare.events import compare_texts
from viso.compare.tolerances import LOG, end_s, tolerances_of
from viso.firmware.releases import Firmware
from viso.replay.ekf.run import FIELDS, EkfReplay, EkfRun, NothingToCompare, until


def estimate_differences(replay: EkfReplay, core: int = 0) -> Iterator[Difference]:
    """Yield the estimates and the texts of a core that differ."""
    tolerances = tolerances_of(LOG)
    for label, field in FIELDS.items():
        columns = replay.recorded[label], replay.ours[label]
        yield from column_differences(field, core, replay.time_s, *columns, tolerances)
    texts = compare_texts(f"MSG of core {core}", replay.recorded_texts, replay.our_texts, tolerances)
    yield from texts.differences


def compare_log(path: Path, firmware: Firmware, on_progress: Callable[[int, int], None]) -> Comparison:
    """Run the filter over a log and compare.

    Raises NothingToCompare if it has no replay records, or no estimates; InputError if it cannot be read.
    """
    run = EkfRun(path, until_s=end_s(path), firmware=firmware)
    run.run(on_progress)
    found = {core: run.comparison(core) for core in run.imus}
    replays = {core: replay.until(end_s(path)) for core, replay in found.items() if replay is not None}
    if not replays:
        raise NothingToCompare(f"{path}: no XKF records to compare with")
    differences = [difference for core, replay in replays.items() for difference in estimate_differences(replay, core)]
    our_lanes, lanes = (until(texts, end_s(path)) for texts in (run.our_lanes, run.recorded_lanes))
    notes = [] if end_s(path) == math.inf else [f"compared up to {end_s(path):g} s"]
    if len(replays) < len(run.imus):
        notes.append("not all cores have estimates in it: changes of the primary core are not compared")
        lanes = []
    else:
        differences += compare_texts("MSG of the lanes", lanes, our_lanes, tolerances_of(LOG)).differences
    records = sum(len(replay.time_s) for replay in replays.values())
    texts = sum(len(replay.recorded_texts) for replay in replays.values()) + len(lanes)
    return Comparison(
        path,
        LOG,
        firmware.name,
        run.frames,
        records,
        records * len(FIELDS) + texts,
        tuple(differences),
        tuple(notes),
    )
