# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fusions of a filter share."""

from collections.abc import Callable
from dataclasses import dataclass

from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.output_predictor import OutputState
from ekf_stub.filter.release import REFERENCE, FilterRelease
from ekf_stub.fusion.aiding import Aiding
from ekf_stub.fusion.measurements import Delayed
from ekf_stub.fusion.origin_height import OriginHeight
from ekf_stub.inputs.ext_nav_ingest import ExtNavIngest
from ekf_stub.inputs.gps_reading import GpsReading
from ekf_stub.inputs.sources import EkfSources
from ekf_stub.reports.core_texts import CoreTexts


@dataclass(frozen=True, slots=True)
class FilterParts:
    """A filter from its first state on.

    Attributes:
        output: what follows the state.
        delayed: external navigation at the horizon.
        ingest: where it waits.
        get_float: returns a parameter by its name after ``EK3_``.
        has_compass: says whether a compass is in use.
        ring_size: how many barometric heights, and how many magnetic fields, wait.
        core: its number.
    """

    state: ErrorState
    output: OutputState
    aiding: Aiding
    sources: EkfSources
    delayed: Delayed
    ingest: ExtNavIngest
    gps: GpsReading
    origin_height: OriginHeight
    texts: CoreTexts
    get_float: Callable[[str], float]
    has_compass: Callable[[], bool]
    ring_size: int
    release: FilterRelease = REFERENCE
    core: int = 0


class Fusion:
    """What every fusion holds of the parts."""

    def __init__(self, parts: FilterParts) -> None:
        self._state = parts.state
        self._output = parts.output
        self._aiding = parts.aiding
        self._sources = parts.sources
        self._delayed = parts.delayed
        self._ingest = parts.ingest
        self._gps = parts.gps
        self._texts = parts.texts
        self._get_float = parts.get_float
