# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""OKVIS2 as a strategy, where its native module is installed."""

from viso.companion.strategies.facade import NativeFacade


class Okvis2(NativeFacade):
    """The engine of the module ``viso_okvis2_native``."""

    name = "okvis2"
    module = "viso_okvis2_native"
