# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot's end of external navigation: vehicle, virtual time, streams, logs, and an autopilot for tests."""

from typing import TYPE_CHECKING

from ap_core.lazy import lazily

if TYPE_CHECKING:
    from viso.errors import InputError
    from viso.firmware.releases import PROFILES, Firmware
    from viso.logs import MemoryLog, read_columns, read_recorded_states
    from viso.running.virtual_time import Scheduler
    from viso.streams import Stream, StreamMessage, read_stream
    from viso.testing import Autopilot, AutopilotOptions, UdpAutopilot
    from viso.vehicle.config import VehicleConfig
    from viso.vehicle.vehicle import Vehicle

__all__ = [
    "PROFILES",
    "Autopilot",
    "AutopilotOptions",
    "Firmware",
    "InputError",
    "MemoryLog",
    "Scheduler",
    "Stream",
    "StreamMessage",
    "UdpAutopilot",
    "Vehicle",
    "VehicleConfig",
    "read_columns",
    "read_recorded_states",
    "read_stream",
]

__getattr__, __dir__ = lazily(__name__)
