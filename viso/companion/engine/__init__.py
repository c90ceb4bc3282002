# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Engines that are programs: their protocol, their process, and a base class for new ones."""

from pathlib import Path
from typing import Final

from viso.companion.engine.program import EngineProgram, run
from viso.companion.engine.protocol import Capability, Reset, Setup, Status

__all__ = ["INCLUDE_DIR", "Capability", "EngineProgram", "Reset", "Setup", "Status", "run"]

INCLUDE_DIR: Final = Path(__file__).parent
"""Where ``viso_engine.hpp`` is."""
