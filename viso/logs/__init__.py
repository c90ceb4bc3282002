# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""DataFlash on disk: writing, numbering, serving, reading back."""

from viso.logs.files import LogFile, LogStore
from viso.logs.logger import LogSink, MemoryLog
from viso.logs.recorded import read_columns, read_recorded_states

__all__ = ["LogFile", "LogSink", "LogStore", "MemoryLog", "read_columns", "read_recorded_states"]
