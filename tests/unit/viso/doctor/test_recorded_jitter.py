# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded stamps and arrivals with late messages, bursts and steps of the clock are named for what they are."""

import gzip
import json
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.places import RECORDED
from tests.unit.viso.doctor.evidences import START_US, evidence_of, findings_of, pose, seen

VECTORS = RECORDED / "vectors" / "jitter_correction.jsonl.gz"
Column = NDArray[np.int64]


@cache
def sequences() -> dict[str, tuple[Column, Column]]:
    """Return stamps and arrivals in us of the longer sequences; what comes behind a late message waits for it."""
    found = {}
    with gzip.open(VECTORS, "rt", encoding="utf-8") as lines:
        for line in lines:
            sequence = json.loads(line)
            if len(sequence["samples"]) >= 250:
                stamp_us, arrival_us, _ = np.array(sequence["samples"], dtype=np.int64).T
                found[sequence["name"]] = stamp_us, np.maximum.accumulate(arrival_us)
    return found


@pytest.mark.parametrize("name", sequences())
def test_recorded_sequence_is_named_for_what_it_is(name: str) -> None:
    stamp_us, arrival_us = sequences()[name]
    messages = [
        seen(number, START_US + int(at - arrival_us[0]), pose(int(stamp)))
        for number, (stamp, at) in enumerate(zip(stamp_us, arrival_us, strict=True), 1)
    ]
    found = findings_of(evidence_of(messages))
    # All of them hold messages that come up to 0.9 s late, with others waiting behind them.
    assert {"XN3-06", "XN3-07", "XN3-08"} <= set(found)
    assert ("XN3-03" in found) == bool(np.any(np.diff(stamp_us) < -1000))
    assert "XN3-01" not in found
    assert "XN3-02" not in found


@pytest.mark.slow
def test_a_leap_of_half_a_minute_is_found_where_it_is() -> None:
    leaps = 0
    for stamp_us, arrival_us in sequences().values():
        ahead = np.flatnonzero(np.diff(stamp_us) - np.diff(arrival_us) > 20_000_000)
        if not len(ahead):
            continue
        leaps += 1
        messages = [
            seen(number, START_US + int(at - arrival_us[0]), pose(int(stamp)))
            for number, (stamp, at) in enumerate(zip(stamp_us, arrival_us, strict=True), 1)
        ]
        assert int(ahead[0]) + 2 in findings_of(evidence_of(messages))["XN3-04"].message_numbers
    assert leaps >= 10
