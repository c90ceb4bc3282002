# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Handler of SET_MODE (GCS_Common.cpp, handle_set_mode)."""

from ap_core.verdict import Verdict
from mav_handlers.context import Context
from mav_handlers.handlers.commands.modes import set_mode
from mav_handlers.handlers.commands.results import MavResult
from mav_handlers.verdicts import HANDLED, MODE_REFUSED
from mav_handlers.wire.messages import SET_MODE


def handle_set_mode(ctx: Context, message: SET_MODE) -> Verdict:
    """Enter a mode or move the safety switch; there is no answer but the next heartbeat, or a text of refusal."""
    result = set_mode(ctx, message.base_mode, message.custom_mode)
    return HANDLED if result is MavResult.ACCEPTED else MODE_REFUSED
