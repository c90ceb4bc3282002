# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated autopilot for tests; pytest's fixtures return these objects."""

from viso.testing.autopilot import Autopilot
from viso.testing.observations import MessageVerdict, Record, SampleOutcome, StatusText
from viso.testing.options import AutopilotOptions
from viso.testing.udp_autopilot import UdpAutopilot

__all__ = ["Autopilot", "AutopilotOptions", "MessageVerdict", "Record", "SampleOutcome", "StatusText", "UdpAutopilot"]
