# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of parameters that another release calls otherwise.

Those of earlier releases are converted as the firmware converts what is stored: ArduCopter/Parameters.cpp
(load_parameters), GCS_Common.cpp (GCS_MAVLINK::init), AP_Arming.cpp. Files of parameters are read the same way, and
those of later releases the other way round, which the firmware does not do.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Final, NamedTuple

from ap_core.param import ParamTable
from ap_core.param_info import ParamType, assigned
from mav_handlers.params.names import (
    PORT_OPTION_NO_STREAM_REQUESTS,
    PORT_OPTION_PRIVATE,
    link_options_of_port,
    port_options_of_link,
)

_MAVLINK_PROTOCOLS: Final = (1, 2, 43)
_PORT_BITS: Final = PORT_OPTION_PRIVATE | PORT_OPTION_NO_STREAM_REQUESTS
_CHECK_ALL: Final = 1 << 0
_SKIP_ALL: Final = -1
_KNOWN_CHECKS: Final = (1 << 21) - 2


def same_value(value: float) -> float:
    """Return the same value."""
    return value


def hundredth(value: float) -> float:
    """Return a hundredth of the value: metres of centimetres, degrees of centidegrees."""
    return 0.01 * value


def hundredfold(value: float) -> float:
    """Return a hundred times the value: centimetres of metres, centidegrees of degrees."""
    return 100 * value


def skip_instead_of_check(value: float) -> float:
    """Return the ARMING_SKIPCHK of an ARMING_CHECK: what was not asked for is skipped, and without any, all there is.

    Raises ValueError for no finite value.
    """
    checks = int(assigned(value, ParamType.INT32))
    if checks == 0:
        return _SKIP_ALL
    return 0 if checks & _CHECK_ALL else ~checks & _KNOWN_CHECKS


def check_instead_of_skip(value: float) -> float:
    """Return the ARMING_CHECK of an ARMING_SKIPCHK: what is not skipped is checked, and if nothing is, all there is.

    Raises ValueError for no finite value.
    """
    skipped = int(assigned(value, ParamType.INT32)) & _KNOWN_CHECKS
    return ~skipped & _KNOWN_CHECKS if skipped else _CHECK_ALL


class Rename(NamedTuple):
    """The name of a parameter since some release, what becomes of its value, and the reverse."""

    new: str
    convert: Callable[[float], float] = same_value
    revert: Callable[[float], float] = same_value


Renames = Mapping[str, Rename]
"""By the name that an earlier release has."""

NO_RENAMES: Final[Renames] = MappingProxyType({})


class Conversion(NamedTuple):
    """A value that was carried over."""

    old: str
    old_value: float
    new: str
    new_value: float

    def __str__(self) -> str:
        """Return both names, and the values where they differ."""
        if self.old_value == self.new_value:
            return f"{self.old} -> {self.new}"
        return f"{self.old} {self.old_value:g} -> {self.new} {self.new_value:g}"


@dataclass(frozen=True, slots=True)
class CarriedOver:
    """Values under the names of a release.

    Attributes:
        values: by name; those of which nothing is known are there as well, unchanged.
        conversions: what was converted.
        lost: old names whose new ones the vehicle does not have: of links that are not there.
    """

    values: dict[str, float]
    conversions: tuple[Conversion, ...]
    lost: tuple[str, ...]


def carry_over(given: Mapping[str, float], params: ParamTable, renames: Renames) -> CarriedOver:
    """Give values of an earlier release the names of a vehicle's; a value that is given under its own name wins.

    Args:
        given: values by name.
        params: the parameters of the vehicle.
        renames: those of all releases; names that the vehicle has are left as they are.

    Raises:
        ValueError: a value that cannot be converted.
    """
    values: dict[str, float] = {}
    conversions, lost = [], []
    for name, value in given.items():
        rename = renames.get(name)
        if rename is None or params.find(name) is not None:
            values[name] = value
        elif params.find(rename.new) is None:
            lost.append(name)
        elif rename.new not in given:
            conversion = Conversion(name, value, rename.new, rename.convert(value))
            values[rename.new] = conversion.new_value
            conversions.append(conversion)
    conversions += _move_port_options(values, params)
    return CarriedOver(values, tuple(conversions), tuple(lost))


def _both_ways(renames: Renames) -> Renames:
    """Return renames with their reverse."""
    return {**renames, **{rename.new: Rename(old, rename.revert, rename.convert) for old, rename in renames.items()}}


def carry_over_from_any(given: Mapping[str, float], params: ParamTable, renames: Renames) -> CarriedOver:
    """Give values of an earlier or a later release the names of a vehicle's; ``renames`` are those of all releases.

    Raises ValueError for a value that cannot be converted.
    """
    carried = carry_over(given, params, _both_ways(renames))
    moved = tuple(_move_link_options(carried.values, params))
    return replace(carried, conversions=(*carried.conversions, *moved))


def _move_port_options(values: dict[str, float], params: ParamTable) -> Iterator[Conversion]:
    """Move what SERIALn_OPTIONS says of MAVLink to the options of the port's link, unless that was done before."""
    for link, port in enumerate(_mavlink_ports(values, params), 1):
        old, new, done = f"SERIAL{port}_OPTIONS", f"MAV{link}_OPTIONS", f"MAV{link}_OPTIONSCNV"
        options = int(assigned(values.get(old, 0), ParamType.INT32))
        if not options & _PORT_BITS or params.find(new) is None or values.get(done):
            continue
        values[old] = options & ~_PORT_BITS
        values[new] = int(values.get(new, 0)) | link_options_of_port(options)
        values[done] = 1
        yield Conversion(old, options, new, values[new])


def _move_link_options(values: dict[str, float], params: ParamTable) -> Iterator[Conversion]:
    """Move MAVn_OPTIONS to the options of the link's port, for a vehicle that has none of a link."""
    for link, port in enumerate(_mavlink_ports(values, params), 1):
        old, new = f"MAV{link}_OPTIONS", f"SERIAL{port}_OPTIONS"
        if old in values and params.find(old) is None and params.find(new) is not None:
            options = int(assigned(values.pop(old), ParamType.INT16))
            values[new] = int(values.get(new, 0)) | port_options_of_link(options)
            yield Conversion(old, options, new, values[new])


def _mavlink_ports(values: Mapping[str, float], params: ParamTable) -> Iterator[int]:
    port = 0
    while (protocol := params.find(f"SERIAL{port}_PROTOCOL")) is not None:
        if values.get(protocol.canonical_name, protocol.value) in _MAVLINK_PROTOCOLS:
            yield port
        port += 1


def name_here(name: str, params: ParamTable, renames: Renames) -> str | None:
    """Return what a vehicle calls a parameter that it does not have under a name of another release; None if nothing.

    Args:
        name: the unknown name.
        params: what the vehicle has.
        renames: of all releases.
    """
    rename = _both_ways(renames).get(name)
    return None if rename is None or params.find(rename.new) is None else rename.new
