# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Receivers of the libraries' records and texts."""

from collections.abc import Sequence
from typing import Protocol

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure


class RecordSink(Protocol):
    """A receiver of log records (AP_Logger::WriteBlock)."""

    def write(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        """Write one record: its structure and a value for each field, in order."""


class TextSink(Protocol):
    """A receiver of texts for the ground station (GCS_SEND_TEXT)."""

    def send_text(self, severity: int, text: str) -> None:
        """Queue a text with its MAV_SEVERITY (0 emergency .. 7 debug)."""
