# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Correction of whole columns of time stamps, to the same microsecond as one call a stamp.

A round of samples (``convergence_loops``) begins with the least difference of the round before, whatever else that
one did. So rounds do not depend on each other: sample by sample, all rounds are computed side by side.
"""

import numpy as np
import numpy.typing as npt

from mav_handlers.jitter_correction import JitterCorrection

Stamps = npt.NDArray[np.uint64]
Differences = npt.NDArray[np.int64]


def correct_column(corrector: JitterCorrection, offboard_usec: Stamps, local_usec: Stamps) -> Stamps:
    """Return the times of samples in us since boot, as ``corrector`` would one after the other; it goes on from there.

    Args:
        corrector: of the link.
        offboard_usec: the sender's stamps.
        local_usec: when each arrived, in us since boot.
    """
    corrected = np.empty(len(offboard_usec), np.uint64)
    round_length = corrector._convergence_loops
    # The first sample of all has no round before it.
    begin = 0 if corrector._initialised else min(1, len(corrected))
    begin += -(corrector._min_sample_counter + begin) % round_length if round_length > 0 else len(corrected)
    begin = min(begin, len(corrected))
    _one_by_one(corrector, slice(0, begin), offboard_usec, local_usec, corrected)
    rounds = (len(corrected) - begin) // round_length if round_length > 0 else 0
    end = begin + rounds * round_length
    if rounds:
        whole, shape = slice(begin, end), (rounds, round_length)
        offboard, local = (stamps[whole].view(np.int64).reshape(shape) for stamps in (offboard_usec, local_usec))
        corrected[whole] = _rounds(corrector, offboard, local).view(np.uint64).reshape(-1)
    _one_by_one(corrector, slice(end, len(corrected)), offboard_usec, local_usec, corrected)
    return corrected


def _one_by_one(
    corrector: JitterCorrection, rows: slice, offboard_usec: Stamps, local_usec: Stamps, corrected: Stamps
) -> None:
    pairs = zip(offboard_usec[rows].tolist(), local_usec[rows].tolist(), strict=True)
    corrected[rows] = [corrector.correct_offboard_timestamp_usec(*pair) for pair in pairs]


def _rounds(corrector: JitterCorrection, offboard: Differences, local: Differences) -> Differences:
    """Return the times of whole rounds, a row each; sums wrap as those of JitterCorrection do."""
    diff = local - offboard
    least = diff.min(axis=1)
    offset = np.concatenate(([corrector._link_offset_usec], least[:-1]))
    estimates = np.empty_like(diff)
    max_lag_us = corrector._max_lag_us
    for sample in range(diff.shape[1]):
        remote, now = offboard[:, sample], local[:, sample]
        offset = np.minimum(offset, diff[:, sample])
        estimate = remote + offset
        is_late = estimate + max_lag_us < now
        estimate = np.where(is_late, now - max_lag_us, estimate)
        offset = np.where(is_late, estimate - remote, offset)
        estimates[:, sample] = estimate
    corrector._link_offset_usec = corrector._min_sample_us = int(least[-1])
    return estimates
