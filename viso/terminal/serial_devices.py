# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the firmware's simulator connects its serial ports to, as its command line says it, and as links here.

Source: AP_HAL_SITL/UARTDriver.cpp (UARTDriver::_begin), AP_HAL_SITL/SITL_State.h (_serial_path).
"""

from typing import Final, NamedTuple

from ap_core.param import ParamTable
from viso.errors import InputError

DEFAULT_DEVICES: Final = ("tcp:0:wait", "tcp:2", "tcp:3", "GPS1", "GPS2", "tcp:5", "tcp:6", "tcp:7", "tcp:8")
"""The devices of SERIAL0 to SERIAL8 where the command line says nothing."""
FORMS: Final = (
    "tcp:PORT[:wait], tcpclient:HOST:PORT, udpclient:HOST[:PORT], mcast:, uart:DEVICE[:BAUD], sim:vicon, none"
)

_VICON: Final = "vicon"
_FEWEST_OF_A_PORT: Final = 1000
"""Up to this a TCP port counts from the base port."""
_UDP_PORT: Final = 14550
_MAVLINK: Final = (1, 2)
_NOTHING: Final = ("GPS1", "GPS2", "none")


class SerialDevice(NamedTuple):
    """What a serial port is connected to.

    Attributes:
        link: the connection string of its link; empty without one.
        waits: the vehicle does not boot before a client has connected to it.
        is_vicon: it is the simulator's own camera.
    """

    link: str = ""
    waits: bool = False
    is_vicon: bool = False


def read_device(option: str, text: str, base_port: int, host: str) -> SerialDevice:
    """Return what an option connects a serial port to.

    Args:
        option: its name, for the error.
        text: the device as the simulator's command line has it.
        base_port: the port from which small port numbers count.
        host: the address that servers bind to.

    Raises:
        InputError: the text has no such form, or the simulated device is not there.
    """
    kind, *rest = text.split(":")
    first, second = (*rest, "", "")[:2]
    match kind:
        case "tcp" if first.isdecimal():
            port = int(first) if int(first) > _FEWEST_OF_A_PORT else base_port + int(first)
            return SerialDevice(f"tcpin:{host}:{port}", waits=second == "wait")
        case "tcpclient" if first and second.isdecimal():
            return SerialDevice(f"tcp:{first}:{second}")
        case "udpclient" if first:
            return SerialDevice(f"udpout:{first}:{second or _UDP_PORT}")
        case "udp" | "udpin" | "udpout" | "mcast":
            return SerialDevice(text)
        case "uart" if first:
            return SerialDevice(f"serial:{first}" + (f",{second}" if second else ""))
        case "sim" if first == _VICON:
            return SerialDevice(is_vicon=True)
        case "sim":
            raise InputError(f"{option} {text}: there is no simulated {first or 'device'} here; there is sim:{_VICON}")
        case _ if kind in _NOTHING:
            return SerialDevice()
    raise InputError(f"{option} {text}: not a device of the forms {FORMS}")


def mavlink_ports(params: ParamTable, count: int) -> list[int]:
    """Return the numbers of the serial ports that speak MAVLink, among the first ``count``, by SERIALn_PROTOCOL."""
    protocols = {number: params.find(f"SERIAL{number}_PROTOCOL") for number in range(count)}
    return [number for number, slot in protocols.items() if slot is not None and int(slot.value) in _MAVLINK]
