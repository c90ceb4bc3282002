# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a vehicle is made of, and how to choose it."""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from ap_core.location import Location
from ap_core.param_cache import FromParams
from ap_visualodom.ports import Ahrs
from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.parts import AhrsParts
from ekf_stub.inputs.sensors import SensorSource
from ekf_stub.log.ext_nav_log import VisualOdomFrame
from mav_handlers.ports import AhrsPort
from mav_handlers.signing.state import KeyStore, MemoryKeyStore
from viso.firmware.releases import REFERENCE, Firmware
from viso.logs.files import LogStore
from viso.logs.sink import LogSink
from viso.parameters.memory import MemoryParamStore, StoredParams
from viso.sensors.options import ImuOptions
from viso.sensors.standing import BenchSource
from viso.sensors.stream.follow import FollowSource
from viso.vehicle.kernels import chosen_kernel, kernel_of


class VehicleAhrs(Ahrs, AhrsPort, Protocol):
    """An AHRS as the vehicle needs it.

    ``ext_nav_counts`` is what the estimator did with how many samples, by kind and code of the rule; ``source`` is
    where its sensors' data come from, None where there are none.
    """

    ext_nav_counts: Counter[tuple[str, str]]
    source: SensorSource | None

    def update(self, camera: VisualOdomFrame) -> None:
        """Run one frame of the estimator, once a pass of the main loop; it is told of the camera."""

    def log_estimates(self) -> None:
        """Log what the estimator says at the moment."""

    def estimator_started(self) -> bool:
        """Tell whether the estimator runs."""

    def origin(self) -> Location | None:
        """Return the EKF origin, or None while unset."""

    def set_origin(self, origin: Location) -> bool:
        """Set the origin, once; tell whether it was set."""

    def healthy(self) -> bool:
        """Tell whether the estimator runs well."""

    def reset_height_datum(self) -> bool:
        """Let heights count from the present one; tell whether the estimator did."""

    def pre_arm_failure(self, requires_position: bool) -> str | None:
        """Return what keeps the vehicle from arming, the text after ``AHRS: ``, or None."""


def by_ekf3(
    make_source: Callable[[ImuOptions], SensorSource], options: ImuOptions
) -> Callable[[AhrsParts], VehicleAhrs]:
    """Return the maker of an AHRS that runs the filter on sensors; the options' compass is the vehicle's."""

    def make(parts: AhrsParts) -> VehicleAhrs:
        source = make_source(replace(options, has_compass=FromParams(parts.params, parts.has_compass)))
        ahrs = Ekf3Ahrs(parts, source, kernel=kernel_of(chosen_kernel()))
        if isinstance(source, FollowSource):
            ahrs.on_pose = source.take_pose
        return ahrs

    return make


def bench(heading_deg: float = 0.0) -> Callable[[AhrsParts], VehicleAhrs]:
    """Return the maker of an AHRS that runs the filter on a vehicle that stands level, with a heading."""
    return by_ekf3(BenchSource, ImuOptions(heading_rad=math.remainder(math.radians(heading_deg), 2 * math.pi)))


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
        firmware: which release it is.
        boot_utc_us: time of day at boot, 0 when unknown.
        message_intervals: default intervals in ms by message id, by number of the link; 0 is off.
    """

    make_ahrs: Callable[[AhrsParts], VehicleAhrs] = field(default_factory=bench)
    links: int = 1
    defaults: Mapping[str, float] = field(default_factory=dict)
    overrides: Mapping[str, float] = field(default_factory=dict)
    open_log: Callable[[], LogSink] | None = None
    log_store: LogStore | None = None
    param_store: StoredParams = field(default_factory=MemoryParamStore)
    signing_store: KeyStore = field(default_factory=MemoryKeyStore)
    firmware: Firmware = REFERENCE
    boot_utc_us: int = 0
    message_intervals: Mapping[int, Mapping[int, int]] = field(default_factory=dict)
