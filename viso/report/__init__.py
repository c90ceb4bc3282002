# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso report`: figures of external navigation in a flight log, a page, and trajectories for other tools."""

from typing import TYPE_CHECKING

from ap_core.lazy import lazily

if TYPE_CHECKING:
    from viso.report.facts import facts_of
    from viso.report.flight_data import read_material
    from viso.report.summary import summarise

__all__ = ["facts_of", "read_material", "summarise"]

__getattr__, __dir__ = lazily(__name__)
