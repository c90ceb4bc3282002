# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters that the endpoint itself reads, by purpose: releases use different names."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from ap_core.param import ParamTable

OPTION_PRIVATE: Final = 1 << 1
OPTION_NO_STREAM_REQUESTS: Final = 1 << 2

PORT_OPTION_PRIVATE: Final = 1 << 10
PORT_OPTION_NO_STREAM_REQUESTS: Final = 1 << 12


@dataclass(frozen=True, slots=True)
class EndpointParams:
    """Names of parameters.

    Attributes:
        system_id: of the vehicle.
        ground_station_id: of the ground station in charge.
        only_ground_station: its bits in ``only_ground_station_bits`` are set when only the ground station in charge is
            obeyed.
        only_ground_station_bits: see there.
        telem_delay: the silence after start-up, s.
        stream_rate: takes the number of a link from 0 and a row's name such as ``_EXTRA1``, returns the full name.
        link_options: takes the parameters and the number of a link, returns its options, as the bits of MAVn_OPTIONS.
        last_ground_station_id: the last id of a range of ground stations in charge, in releases that have it.
    """

    system_id: str
    ground_station_id: str
    only_ground_station: str
    only_ground_station_bits: int
    telem_delay: str
    stream_rate: Callable[[int, str], str]
    link_options: Callable[[ParamTable, int], int]
    last_ground_station_id: str | None = None

    def is_ground_station(self, params: ParamTable, system_id: int) -> bool:
        """Return whether a system is a ground station in charge: one, or a range of ids (GCS::sysid_is_gcs)."""
        first = last = params.get_int(self.ground_station_id)
        if self.last_ground_station_id is not None:
            last = max(first, params.get_int(self.last_ground_station_id))
        return first <= system_id <= last


def options_of_link(params: ParamTable, index: int) -> int:
    """Return MAVn_OPTIONS of a link, numbered from 0."""
    return params.get_int(f"MAV{index + 1}_OPTIONS")


def options_of_port(params: ParamTable, index: int) -> int:
    """Return a link's options from SERIALn_OPTIONS of its port; none if the port has no such parameter.

    FIRMWARE PARITY: the firmware uses the link's real port; here the first link is on the first port, and so on.
    """
    name = f"SERIAL{index}_OPTIONS"
    options = params.get_int(name) if params.find(name) is not None else 0
    return link_options_of_port(options)


def link_options_of_port(options: int) -> int:
    """Return the bits of MAVn_OPTIONS for those of SERIALn_OPTIONS that concern MAVLink (GCS_MAVLINK::init)."""
    private = OPTION_PRIVATE if options & PORT_OPTION_PRIVATE else 0
    return private | (OPTION_NO_STREAM_REQUESTS if options & PORT_OPTION_NO_STREAM_REQUESTS else 0)


def port_options_of_link(options: int) -> int:
    """Return the bits of SERIALn_OPTIONS for those of MAVn_OPTIONS: the reverse."""
    private = PORT_OPTION_PRIVATE if options & OPTION_PRIVATE else 0
    return private | (PORT_OPTION_NO_STREAM_REQUESTS if options & OPTION_NO_STREAM_REQUESTS else 0)


MAV_NAMES: Final = EndpointParams(
    "MAV_SYSID",
    "MAV_GCS_SYSID",
    "MAV_OPTIONS",
    1 << 0,
    "MAV_TELEM_DELAY",
    lambda index, row: f"MAV{index + 1}{row}",
    options_of_link,
)
"""Since 2025-04-07."""

MAV_NAMES_WITH_RANGE: Final = replace(MAV_NAMES, last_ground_station_id="MAV_GCS_SYSID_HI")
"""Since 2025-07-29."""

SYSID_NAMES: Final = EndpointParams(
    "SYSID_THISMAV",
    "SYSID_MYGCS",
    "SYSID_ENFORCE",
    -1,
    "TELEM_DELAY",
    lambda index, row: f"SR{index}{row}",
    options_of_port,
)
"""Up to 4.6."""
