# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows as a sweep would have them, without any replay."""

from collections.abc import Callable
from typing import Any

from viso.replay.figures import OBJECTIVES
from viso.sweep.dimensions import Axis
from viso.sweep.plan import InputFile, Recorded, Sampling, SweepPlan
from viso.sweep.store import table_rows


def made_plan(*axes: Axis, sampling: Sampling | None = None, imu: str = "log:a.BIN", **others: Any) -> SweepPlan:
    """Return a plan whose files nobody reads."""
    recorded = Recorded("one", InputFile("/one.tum", "0" * 64), imu)
    return SweepPlan((recorded,), axes, {"2025-07": {}}, ("2025-07",), sampling=sampling, **others)


def made_rows(plan: SweepPlan, nis: Callable[..., float | None], **figures: float | None) -> list[dict[str, Any]]:
    """Return the rows of a plan whose ``nis`` is a function of the axes' values."""
    usual = {**dict.fromkeys(OBJECTIVES), "stamp_lag_ms": 7.5, **figures}
    return table_rows(plan, {point.number: {**usual, "nis": nis(*point.values)} for point in plan.points()})
