# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle is made of, and how to choose it."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from ap_core.clock import VirtualClock
from ap_core.location import Location
from ap_core.param import ParamTable
from ap_core.sinks import TextSink
from ap_visualodom.ports import Ahrs
from ekf_stub.ahrs_bench import BenchAhrs
from ekf_stub.ext_nav_log import ExtNavLog
from ekf_stub.gps_sample import GpsSample
from ekf_stub.sources import EkfSources
from emulator.firmware import REFERENCE, Firmware
from emulator.log_files import LogStore
from emulator.log_sink import LogSink
from emulator.param_store import ParamStore
from mav_handlers.ports import AhrsPort
from mav_handlers.signing import KeyStore, MemoryKeyStore


class VehicleAhrs(Ahrs, AhrsPort, Protocol):
    """An AHRS as the vehicle needs it."""

    def update(self) -> None:
        """Run one frame of the estimator, once a pass of the main loop."""

    def estimator_started(self) -> bool:
        """Tell whether the estimator runs."""

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once; tell whether it was set."""

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what keeps the vehicle from arming, the text after ``AHRS: ``, or None."""


@dataclass(frozen=True, slots=True)
class AhrsParts:
    """What an AHRS is made of.

    ``gps`` returns the newest solution of the GPS, ``is_armed`` and ``visual_odom_enabled`` what their names say.
    """

    clock: VirtualClock
    sources: EkfSources
    log: ExtNavLog
    params: ParamTable
    texts: TextSink
    gps: Callable[[], GpsSample | None]
    is_armed: Callable[[], bool]
    visual_odom_enabled: Callable[[], bool]


def bench(heading_deg: float = 0.0) -> Callable[[AhrsParts], VehicleAhrs]:
    """Return the maker of an AHRS that stands still, level, with a heading; it has a compass if COMPASS_USE says so."""

    def make(parts: AhrsParts) -> VehicleAhrs:
        return BenchAhrs(
            parts.clock,
            parts.sources,
            parts.log,
            heading_rad=math.radians(heading_deg),
            has_compass=lambda: parts.params.get_int("COMPASS_USE") != 0,
        )

    return make


@dataclass(frozen=True)
class VehicleConfig:
    """How to build a vehicle.

    Attributes:
        make_ahrs: makes the AHRS; a vehicle on the bench, heading north, unless told otherwise.
        links: how many links it will have.
        defaults: parameter values by name that count as its defaults, as from a defaults file.
        overrides: parameter values by name that hold whatever defaults and stored values say.
        open_log: opens the next log; None for no logging, or for the next one of ``log_store``.
        log_store: the folder of logs, which clients may list, download and erase.
        param_store: where parameters are kept over a restart.
        signing_store: where the signing key is kept.
        firmware: what it claims to be.
        boot_utc_us: time of day at boot, 0 when unknown.
    """

    make_ahrs: Callable[[AhrsParts], VehicleAhrs] = field(default_factory=bench)
    links: int = 1
    defaults: Mapping[str, float] = field(default_factory=dict)
    overrides: Mapping[str, float] = field(default_factory=dict)
    open_log: Callable[[], LogSink] | None = None
    log_store: LogStore | None = None
    param_store: ParamStore | None = None
    signing_store: KeyStore = field(default_factory=MemoryKeyStore)
    firmware: Firmware = REFERENCE
    boot_utc_us: int = 0
