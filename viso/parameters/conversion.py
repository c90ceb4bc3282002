# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of parameters that an earlier release called otherwise, converted as the firmware converts what is stored.

Source: ArduCopter/Parameters.cpp (load_parameters), GCS_Common.cpp (GCS_MAVLINK::init), AP_Arming.cpp. The firmware
does so with its storage alone; here files of parameters are read the same way.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, NamedTuple

from ap_core.param import ParamTable
from ap_core.param_info import ParamType, assigned
from mav_handlers.params.names import PORT_OPTION_NO_STREAM_REQUESTS, PORT_OPTION_PRIVATE, link_options_of_port

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


def skip_instead_of_check(value: float) -> float:
    """Return the ARMING_SKIPCHK of an ARMING_CHECK: what was not asked for is skipped, and without any, all there is.

    Raises ValueError for no finite value.
    """
    checks = int(assigned(value, ParamType.INT32))
    if checks == 0:
        return _SKIP_ALL
    return 0 if checks & _CHECK_ALL else ~checks & _KNOWN_CHECKS


class Rename(NamedTuple):
    """The name of a parameter since some release, and what becomes of its value."""

    new: str
    convert: Callable[[float], float] = same_value


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
    """Give values the names of a release; a value that is given under its new name wins.

    Args:
        given: values by name.
        params: the parameters of the release.
        renames: what it calls otherwise than earlier ones.

    Raises:
        ValueError: a value that cannot be converted.
    """
    values: dict[str, float] = {}
    conversions, lost = [], []
    for name, value in given.items():
        rename = renames.get(name)
        if rename is None:
            values[name] = value
        elif params.find(rename.new) is None:
            lost.append(name)
        elif rename.new not in given:
            conversion = Conversion(name, value, rename.new, rename.convert(value))
            values[rename.new] = conversion.new_value
            conversions.append(conversion)
    conversions += _move_port_options(values, params)
    return CarriedOver(values, tuple(conversions), tuple(lost))


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
    later = [renames[name].new] if name in renames else []
    earlier = [old for old, rename in renames.items() if rename.new == name]
    return next((other for other in (*later, *earlier) if params.find(other) is not None), None)
