# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""DataFlash on disk: writing, numbering, serving, reading back."""

from viso.logs.files import LogFile, LogStore
from viso.logs.recorded import read_columns, read_recorded_states
from viso.logs.sink import LogSink, MemoryLog

__all__ = ["LogFile", "LogSink", "LogStore", "MemoryLog", "read_columns", "read_recorded_states"]
