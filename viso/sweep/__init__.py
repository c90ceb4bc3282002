# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso sweep`: many replays of streams with changed parameters, faults, seeds and firmware, and their results."""

from viso.sweep.job import run_point
from viso.sweep.planning import make_plan
from viso.sweep.request import SweepRequest

__all__ = ["SweepRequest", "make_plan", "run_point"]
