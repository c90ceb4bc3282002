# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How long the buffers of a core are."""

from collections.abc import Callable
from typing import Final

from ekf_stub.inputs.gps_sample import USUAL_LAG_S, whole_ms
from ekf_stub.inputs.obs_ring import RingSizes, ring_sizes
from ekf_stub.inputs.sources import EkfSources

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
    """Return the lengths of the estimator's buffers (NavEKF3_core::setup_core), enough for a delay of ``least_ms``.

    ``get_int`` takes a parameter's full name, ``gps_lag_s`` is what the GPS receiver is said to be late.
    """
    delays = [get_int(f"EK3_{name}_DELAY") for name in ("HGT", "FLOW", "BCN")]
    if sources.uses_gps():
        delays.append(min(whole_ms(gps_lag_s), MAX_DELAY_MS))
    if has_camera:
        delays.append(min(get_int("VISO_DELAY_MS"), MAX_DELAY_MS))
    sizes = ring_sizes(max(*delays, _MAG_DELAY_MS, min(least_ms, MAX_DELAY_MS)))
    return sizes._replace(flow=sizes.ext_nav) if has_flow else sizes  # they come as often
