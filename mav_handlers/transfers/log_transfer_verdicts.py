# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules by which requests for logs are turned down."""

from typing import Final

from ap_core.verdict import dropped

_FILE: Final = "AP_Logger_MAVLinkLogTransfer.cpp"
_LIST: Final = f"{_FILE}, handle_log_request_list"
_DATA: Final = f"{_FILE}, handle_log_request_data"
_MESSAGE: Final = f"{_FILE}, handle_log_message"

LOG_NOT_READY: Final = dropped("log_not_ready", "the logger does not write yet; the firmware is silent", _MESSAGE)
LOG_ARMED: Final = dropped("log_armed", "logs are sent only while disarmed", _MESSAGE)
LOG_BUSY: Final = dropped("log_busy", "a log transfer is under way", _LIST)
LOG_REPEATED: Final = dropped("log_repeated", "this link's log transfer is under way; the firmware is silent", _DATA)
LOG_UNKNOWN: Final = dropped("log_unknown", "there is no log of that id; the firmware is silent", _DATA)
