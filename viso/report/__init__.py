# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso report`: figures of external navigation in a flight log, a page, and trajectories for other tools."""

from viso.report.facts import facts_of
from viso.report.flight_data import read_material
from viso.report.summary import summarise

__all__ = ["facts_of", "read_material", "summarise"]
