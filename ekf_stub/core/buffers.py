# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the buffers of a core are (AP_NavEKF3/AP_NavEKF3_core.cpp, NavEKF3_core::setup_core)."""

from collections.abc import Callable
from typing import Final

from ekf_stub.core.params import EkfSources
from ekf_stub.core.samples import RingSizes
from ekf_stub.inputs.measurements import USUAL_LAG_S, whole_ms

_MAG_DELAY_MS: Final = 60
MAX_DELAY_MS: Final = 250


def buffer_sizes(
    get_int: Callable[[str], int],
    sources: EkfSources,
    *,
    has_camera: bool,
    has_flow: bool = False,
    gps_lag_s: float = USUAL_LAG_S,
    least_ms: int = 0,
) -> RingSizes:
    """Return the lengths of the filter's buffers, enough for a delay of ``least_ms``.

    ``get_int`` takes a parameter's full name, ``gps_lag_s`` is what the GPS receiver is said to be late.
    """
    longest_ms = max(_MAG_DELAY_MS, min(least_ms, MAX_DELAY_MS))
    for name in ("HGT", "FLOW", "BCN"):
        longest_ms = max(longest_ms, get_int(f"EK3_{name}_DELAY"))
    if sources.uses_gps():
        longest_ms = max(longest_ms, min(whole_ms(gps_lag_s), MAX_DELAY_MS))
    if has_camera:
        longest_ms = max(longest_ms, min(get_int("VISO_DELAY_MS"), MAX_DELAY_MS))
    return RingSizes(longest_ms, has_flow)
