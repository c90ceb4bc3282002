# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All that is said of lags is one estimate, and nothing is said where a clock tells none."""

import numpy as np
import pytest

from tests.unit.viso.doctor.evidences import START_US, evidence_of, findings_of, pose, seen
from viso.doctor import Evidence
from viso.doctor.evidence.tracks import Floats
from viso.doctor.output.summary import summarise

SENT_S = np.arange(0, 40, 0.04)


def made_of(stamp_s: Floats, late_s: Floats | float = 0.0) -> Evidence:
    arrival_us = np.maximum.accumulate(START_US + np.round(1e6 * (SENT_S + late_s)).astype(np.int64)).tolist()
    stamps_us = (1 + np.round(1e6 * stamp_s)).astype(np.int64).tolist()
    rows = enumerate(zip(arrival_us, stamps_us, strict=True), 1)
    return evidence_of([seen(number, at_us, pose(stamp_us)) for number, (at_us, stamp_us) in rows])


@pytest.mark.parametrize("factor", [1.0, 1.006, 0.995])
def test_summary_and_finding_tell_the_same_lags(factor: float) -> None:
    late_s = np.where(np.arange(len(SENT_S)) % 10 == 0, 0.12, 0.0)
    made = made_of(factor * SENT_S, late_s)
    (lags,) = summarise(made).lags
    assert f"(median {lags.median_ms:.0f} ms, one in a hundred {lags.p99_ms:.0f} ms or more)" in (
        findings_of(made)["XN3-06"].evidence
    )
    assert lags.worst_ms == pytest.approx(120, abs=10)


@pytest.mark.parametrize("factor", [1.1, 30.0, 0.9])
def test_clock_that_runs_otherwise_tells_no_lag(factor: float) -> None:
    made = made_of(factor * SENT_S)
    assert summarise(made).lags == ()
    found = findings_of(made)
    assert not {"XN3-04", "XN3-05", "XN3-06", "XN3-07", "XN3-08", "XN3-10", "XN6-01"} & set(found)
    assert f"{factor:.3f} times as much" in found["XN3-12"].evidence


def test_small_drift_is_told_though_it_is_no_line() -> None:
    drifting = SENT_S + np.interp(SENT_S, (0, 10, 25, 30, 40), (0, 0, 0.1, 0.25, 0.35))
    assert "0.8" in (text := findings_of(made_of(drifting))["XN3-05"].evidence)
    assert text.endswith("% too fast in all, not steadily, over 40 s")
    assert "XN3-05" not in findings_of(made_of(SENT_S - np.interp(SENT_S, (0, 10, 20, 40), (0, 0.35, 0, 0))))
