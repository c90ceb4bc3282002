# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages that the vehicle can send, in the firmware's order, and their contents.

A builder returns None when there is nothing to report; the message is then left out.
"""

from mav_handlers.senders.builder import Builder, nothing_to_report
from mav_handlers.senders.position import gps_global_origin, home_position
from mav_handlers.senders.table import MOVING_ON, SENDERS, STREAM_GROUPS

__all__ = [
    "MOVING_ON",
    "SENDERS",
    "STREAM_GROUPS",
    "Builder",
    "gps_global_origin",
    "home_position",
    "nothing_to_report",
]
