# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A vehicle that can be restarted by its clients, on links that outlive the restart."""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mav_handlers.channel import Channel, CountKey
from viso.vehicle.outcomes import FilterCounts
from viso.vehicle.vehicle import Vehicle, VehicleConfig


@dataclass(frozen=True, slots=True)
class Port:
    """A port of the autopilot; ``beside`` is the number of the port that it is a further client of, if it is one's."""

    name: str
    baud: int | None = None
    beside: int | None = None


class PoweredVehicle:
    """The vehicle that is running, and how to start the next one.

    A restart forgets everything but stored parameters, the signing key and the logs: a new log begins, and time counts
    from 0 again. The ports, one for each of its links, stay. ``on_boot`` is called with each vehicle before it runs.

    Attributes:
        vehicle: the one that runs now.
        channels: its links, in the order of the ports; those of further clients come and go at the end.
    """

    def __init__(
        self, config: VehicleConfig, ports: Sequence[Port], on_boot: Callable[[Vehicle], None] = lambda _vehicle: None
    ) -> None:
        self._config = config
        self._ports = list(ports)
        self._on_boot = on_boot
        self._counts: Counter[CountKey] = Counter()
        self._filter_counts: Counter[tuple[str, str]] = Counter()
        self._log_losses: Counter[str] = Counter()
        self._start()

    def _start(self) -> None:
        self.vehicle = Vehicle(self._config)
        self.channels: list[Channel] = []
        for port in self._ports:
            self._open(port)
        self._overridden = {name: self._value(name) for name in self._config.overrides}
        self._on_boot(self.vehicle)

    def _open(self, port: Port) -> None:
        now_us = self.vehicle.clock.micros64()
        channel = self.vehicle.endpoint.open_channel(port.name, baud=port.baud, now_us=now_us, port=port.beside)
        self.channels.append(channel)

    def add_client(self, name: str, beside: int) -> None:
        """Open a channel for a further client of the port with a number; it stays over restarts."""
        port = Port(name, self._ports[beside].baud, beside)
        self._open(port)
        self._ports.append(port)

    def remove_client(self, place: int) -> None:
        """Close the channel of a further client, which has this place among the channels."""
        self.vehicle.endpoint.close_channel(self.channels.pop(place))
        del self._ports[place]

    def _value(self, name: str) -> np.float32 | None:
        param = self.vehicle.params.find(name)
        return None if param is None else param.value

    def restart_if_asked(self) -> bool:
        """Restart the vehicle if a client asked for it, once its answer has left; say whether it was."""
        if not self.vehicle.reboot_requested:
            return False
        self.close()
        self._counts += self.vehicle.endpoint.verdict_counts()
        self._filter_counts += self.vehicle.ahrs.ext_nav_counts
        self._log_losses += self.vehicle.logger.losses
        # What a client has set otherwise since is what it expects to find after the restart.
        config = self._config
        overrides = {name: to for name, to in config.overrides.items() if self._value(name) == self._overridden[name]}
        # Only a clock that was right at boot runs on; one that was set by GPS or MAVLink is lost.
        boot_utc_us = self.vehicle.rtc.utc_us() if config.boot_utc_us else 0
        self._config = replace(config, overrides=overrides, boot_utc_us=boot_utc_us)
        self._start()
        return True

    def verdict_counts(self) -> dict[CountKey, int]:
        """Return how often each message type met each verdict, over all links and restarts."""
        return self._counts + Counter(self.vehicle.endpoint.verdict_counts())

    def filter_counts(self) -> FilterCounts:
        """Return what the filter did with how many samples, over all restarts."""
        return self._filter_counts + self.vehicle.ahrs.ext_nav_counts

    def log_losses(self) -> Counter[str]:
        """Return how many records of the log are lost for which reason, over all restarts."""
        return self._log_losses + self.vehicle.logger.losses

    def close(self) -> None:
        """Close the log properly, and keep the parameters."""
        self.vehicle.close()
