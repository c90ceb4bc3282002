# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The origin that all cores share (AP_NavEKF3.h, common_EKF_origin)."""

from dataclasses import dataclass

from ap_core.location import Location


@dataclass(slots=True)
class CommonOrigin:
    """Where told positions count from: the first origin that any core has set, None before."""

    place: Location | None = None
