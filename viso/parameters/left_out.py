# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What parameters ask of the firmware, for the most part of its filter, that is not done here."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

_BEACON: Final = 4
_BEACONS, _DRAG = "range beacons are not fused here", "drag is not fused, and wind not estimated here"
_SOURCES: Final = [f"EK3_SRC{n}_{what}" for n in (1, 2, 3) for what in ("POSXY", "VELXY", "POSZ", "VELZ")]

_ASKING: Final[Mapping[str, tuple[Callable[[float], bool], str]]] = MappingProxyType(
    {
        **dict.fromkeys(_SOURCES, (lambda value: value == _BEACON, _BEACONS)),
        "BCN_TYPE": (bool, _BEACONS),
        **{f"EK3_DRAG_{name}": (lambda value: value > 0, _DRAG) for name in ("BCOEF_X", "BCOEF_Y", "MCOEF")},
        "ARSPD_TYPE": (bool, "airspeed is not fused here"),
        "FENCE_ENABLE": (bool, "no fence is kept here"),
    }
)
"""By which values a parameter asks for what."""


def may_ask(name: str) -> bool:
    """Return whether a parameter may ask for what there is not."""
    return name in _ASKING


def left_out(params: Mapping[str, float]) -> tuple[str, ...]:
    """Return what parameters, by name, ask for in vain, a line each."""
    return tuple(
        f"{name} is {params[name]:g}: {what}"
        for name, (asks, what) in _ASKING.items()
        if name in params and asks(params[name])
    )
