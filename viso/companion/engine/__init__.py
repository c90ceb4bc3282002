# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Engines that are programs of their own: the bytes that are spoken with them, the process, and a base for new ones."""

from pathlib import Path
from typing import Final

INCLUDE_DIR: Final = Path(__file__).parent
"""Where ``viso_engine.hpp`` is."""
