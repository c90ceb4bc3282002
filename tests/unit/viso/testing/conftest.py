# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An autopilot that has booted."""

import pytest

from viso.testing import Autopilot, AutopilotOptions


@pytest.fixture
def autopilot() -> Autopilot:
    """Return an autopilot with the usual parameters and a least quality of 50."""
    return Autopilot(AutopilotOptions(params={"VISO_QUAL_MIN": 50}))
