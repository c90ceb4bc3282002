# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter: state, covariance, prediction, every fusion, modes, resets, several cores and lanes.

All other modules of this folder are also compiled, where there is a compiler.
"""

from typing import Final

from ap_core.native import use_compiled

IS_COMPILED: Final = use_compiled(__name__, __path__)
