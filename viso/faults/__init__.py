# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults on a seeded timeline, for any stream of MAVLink frames, in virtual time."""

from viso.faults.injector import EntryTally, Injector, Tally, TimedFrame, inject, run_through
from viso.faults.kinds import FAULTS
from viso.faults.timeline import Entry, Timeline, TimelineError, load_timeline, make_entry, parse_timeline

__all__ = [
    "FAULTS",
    "Entry",
    "EntryTally",
    "Injector",
    "Tally",
    "TimedFrame",
    "Timeline",
    "TimelineError",
    "inject",
    "load_timeline",
    "make_entry",
    "parse_timeline",
    "run_through",
]
