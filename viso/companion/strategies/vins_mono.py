# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""VINS-Mono as a strategy, where its native module is installed."""

from viso.companion.strategies.facade import NativeFacade


class VinsMono(NativeFacade):
    """The engine of the module ``viso_vins_mono_native``."""

    name = "vins_mono"
    module = "viso_vins_mono_native"
