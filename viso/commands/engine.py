# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso engine``: where the header for engines is."""

from viso.companion.engine import INCLUDE_DIR
from viso.terminal.console import out


def engine() -> None:
    """Print the folder of viso_engine.hpp, the header for engines in C++ that viso vio --engine runs.

    As in: g++ -std=c++17 -O2 -I "$(viso engine)" my_engine.cpp -o my_engine

    Example: viso engine
    """
    out.print(str(INCLUDE_DIR), soft_wrap=True, highlight=False, markup=False)
