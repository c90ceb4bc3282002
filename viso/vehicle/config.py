# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle is made of, and how to choose it."""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ekf_stub.ahrs.ahrs_base import AHRS_START_US, AhrsBase
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.vehicle_state import compass_in_use
from mav_handlers.signing import KeyStore, MemoryKeyStore
from mav_handlers.transfers.mission_items import ItemStore, MemoryItemStore
from viso.firmware.releases import DEFAULT, Firmware
from viso.logs.files import LogStore
from viso.logs.logger import LogSink
from viso.parameters.store import MemoryParamStore, StoredParams
from viso.vehicle.sensors.source import ImuOptions, VehicleSource
from viso.vehicle.sensors.standing import BenchSource

if TYPE_CHECKING:
    from viso.vehicle.vehicle import Vehicle


def by_ekf3(
    make_source: Callable[[ImuOptions], VehicleSource], options: ImuOptions, *, buffer_ms: int = 0
) -> Callable[["Vehicle"], AhrsBase]:
    """Return the maker of an AHRS that runs the filter on sensors, whose compass and parameters are the vehicle's.

    Args:
        make_source: makes the sensors.
        options: of the sensors.
        buffer_ms: a delay for which the filter's buffers are long enough in any case.
    """

    def make(vehicle: "Vehicle") -> AhrsBase:
        params = vehicle.params
        source = make_source(replace(options, has_compass=compass_in_use(params), params=params))
        return Ekf3Ahrs(
            source,
            vehicle.clock,
            vehicle.sources,
            vehicle.replay_log,
            vehicle.logger,
            params,
            vehicle.texts,
            vehicle.firmware.ekf,
            start_us=AHRS_START_US if source.flight is None else source.flight.ahrs_start_us,
            buffer_ms=buffer_ms,
        )

    return make


def bench(heading_deg: float = 0.0) -> Callable[["Vehicle"], AhrsBase]:
    """Return the maker of an AHRS that runs the filter on a vehicle that stands level, with a heading."""
    return by_ekf3(BenchSource, ImuOptions(heading_rad=math.remainder(math.radians(heading_deg), 2 * math.pi)))


@dataclass(frozen=True)
class VehicleConfig:
    """How to build a vehicle.

    Attributes:
        make_ahrs: makes the AHRS of a vehicle whose clock, parameters, texts and logs are there already; unless told
            otherwise it stands on the bench, heading north.
        links: how many links it will have.
        vicon: whether the simulator's own camera sees it, on one link more; it takes a vehicle that flies.
        defaults: parameter values by name that count as its defaults, as from a defaults file.
        read_only: names among ``defaults`` that clients may not set.
        overrides: parameter values by name that hold whatever defaults and stored values say.
        open_log: opens the next log; None for no logging, or for the next one of ``log_store``.
        log_store: the folder of logs, which clients may list, download and erase.
        param_store: where parameters are kept over a restart.
        item_store: where missions, fences and rally points are kept over a restart.
        signing_store: where the signing key is kept.
        firmware: which release it is.
        boot_utc_us: time of day at boot, 0 when unknown.
        message_intervals: default intervals in ms by message id, by number of the link; 0 is off.
    """

    make_ahrs: Callable[["Vehicle"], AhrsBase] = field(default_factory=bench)
    links: int = 1
    vicon: bool = False
    defaults: Mapping[str, float] = field(default_factory=dict)
    read_only: Collection[str] = ()
    overrides: Mapping[str, float] = field(default_factory=dict)
    open_log: Callable[[], LogSink] | None = None
    log_store: LogStore | None = None
    param_store: StoredParams = field(default_factory=MemoryParamStore)
    item_store: ItemStore = field(default_factory=MemoryItemStore)
    signing_store: KeyStore = field(default_factory=MemoryKeyStore)
    firmware: Firmware = DEFAULT
    boot_utc_us: int = 0
    message_intervals: Mapping[int, Mapping[int, int]] = field(default_factory=dict)
