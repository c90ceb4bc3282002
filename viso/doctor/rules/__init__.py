# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""All rules, a file a family; a new rule is a function in its family's file, its texts above it.

A rule never reads a stream. It looks at ``Evidence``: the stream as it was tried on the vehicle, measured in every way
that any rule needs. So a rule is a short function that yields sightings, and some words: how bad it is, what the
autopilot does, where the firmware decides that, and what to change. The page on the codes is made of these words.

A false alarm costs more than a miss, for somebody would change what was right. Therefore a rule names the messages that
show it, is silent until there are enough of them, is not asked at all of a recording that lacks what it needs
(``needs``), and says by its ``witness`` what it rests on. The vehicle that really flew is believed first: where its own
filter contradicts the model, the model's opinion is no more than a note.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from ap_core.plugins import with_plugins
from viso.doctor.findings import Rule
from viso.doctor.rules import (
    alignment,
    axes,
    clocks,
    flow,
    frames,
    lateness,
    misfit,
    numbers,
    outcome,
    parameters,
    quality,
    ranging,
    rate,
    recorded,
    release,
    resets,
    sizes,
    transport,
)

FAMILIES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "XN1": "Transport",
        "XN2": "Frames and axes",
        "XN3": "Time",
        "XN4": "Rate",
        "XN5": "Numbers",
        "XN6": "Resets and quality",
        "XN7": "Parameters",
        "XN8": "Alignment",
        "XN9": "The filter: the model's, and the vehicle's own",
        "XNF": "Optical flow",
        "XNR": "Range finders",
    }
)

_FILES: Final = (
    *(transport, frames, axes, clocks, lateness, rate, numbers, sizes),
    *(release, resets, quality, parameters, alignment, misfit, outcome, recorded),
    *(flow, ranging),
)
_FOUND: Final = (value for file in _FILES for value in vars(file).values() if isinstance(value, Rule))

RULES: Final = tuple(sorted(_FOUND, key=lambda rule: rule.code))
"""All rules that are built in, in order of their codes."""


def all_rules() -> tuple[Rule, ...]:
    """Return the rules in order of their codes, those of plug-ins too, whose entry points have the codes for names."""
    rules = with_plugins("viso.doctor_rules", {rule.code: rule for rule in RULES}, Rule)
    return tuple(rules[code] for code in sorted(rules))
