# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands: dispatch, and a module for each topic."""

from mav_handlers.handlers.commands.dispatch import COMMANDS, handle_command_int, handle_command_long, to_command_int
from mav_handlers.handlers.commands.results import MavCmd, MavResult

__all__ = ["COMMANDS", "MavCmd", "MavResult", "handle_command_int", "handle_command_long", "to_command_int"]
