# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""VINS-Mono as a strategy, where its native module is installed or its program is named."""

from viso.companion.strategies.engine import EngineStrategy


class VinsMono(EngineStrategy):
    """The engine of a program, or of the module ``viso_vins_mono_native``."""

    name = "vins_mono"
    module = "viso_vins_mono_native"
