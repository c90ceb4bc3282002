# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which strategies this build has: flags that are read once and hold for the whole run.

The environment has no say in them. A test that wants other flags makes its own and hands them to the factory.
"""

import importlib.util
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

BUILD_KLT_RANSAC: Final = "BUILD_KLT_RANSAC"
BUILD_FIXED_LAG: Final = "BUILD_FIXED_LAG"
BUILD_OKVIS2: Final = "BUILD_OKVIS2"
BUILD_VINS_MONO: Final = "BUILD_VINS_MONO"


def read_flags() -> Mapping[str, bool]:
    """Return the flags of this build."""
    return MappingProxyType(
        {
            BUILD_KLT_RANSAC: True,
            BUILD_FIXED_LAG: importlib.util.find_spec("gtsam") is not None,
            BUILD_OKVIS2: importlib.util.find_spec("viso_okvis2_native") is not None,
            BUILD_VINS_MONO: importlib.util.find_spec("viso_vins_mono_native") is not None,
        }
    )


FLAGS: Final = read_flags()
