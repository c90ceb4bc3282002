# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The rules by which requests for logs are turned down."""

from typing import Final

from ap_core.verdict import Outcome, Rule, Verdict

_FILE: Final = "AP_Logger_MAVLinkLogTransfer.cpp"


def _dropped(code: str, text: str, function: str) -> Verdict:
    return Verdict(Outcome.DROPPED, Rule(code, text, f"{_FILE}, {function}"))


LOG_NOT_READY: Final = _dropped(
    "log_not_ready", "the logger does not write yet; the firmware is silent", "handle_log_message"
)
LOG_ARMED: Final = _dropped("log_armed", "logs are sent only while disarmed", "handle_log_message")
LOG_BUSY: Final = _dropped("log_busy", "a log transfer is under way", "handle_log_request_list")
LOG_REPEATED: Final = _dropped(
    "log_repeated", "this link's log transfer is under way; the firmware is silent", "handle_log_request_data"
)
LOG_UNKNOWN: Final = _dropped(
    "log_unknown", "there is no log of that id; the firmware is silent", "handle_log_request_data"
)

VERDICTS: Final = (LOG_NOT_READY, LOG_ARMED, LOG_BUSY, LOG_REPEATED, LOG_UNKNOWN)
