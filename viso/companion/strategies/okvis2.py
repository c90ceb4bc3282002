# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""OKVIS2 as a strategy, where its native module is installed or its program is named."""

from viso.companion.strategies.engine import EngineStrategy


class Okvis2(EngineStrategy):
    """The engine of a program, or of the module ``viso_okvis2_native``."""

    name = "okvis2"
    module = "viso_okvis2_native"
