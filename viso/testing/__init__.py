# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated autopilot for tests of software that sends external navigation; pytest's fixtures return these."""

from emulator.testing.autopilot import Autopilot
from emulator.testing.options import AutopilotOptions
from emulator.testing.seen import MessageVerdict, Record, SampleFate, StatusText
from emulator.testing.udp_autopilot import UdpAutopilot

__all__ = ["Autopilot", "AutopilotOptions", "MessageVerdict", "Record", "SampleFate", "StatusText", "UdpAutopilot"]
