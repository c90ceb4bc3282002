# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes logs whose every record is known, for the tests of the report."""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from ap_core.dataflash import DataFlashWriter
from ap_core.log_field import LogValue
from ap_core.log_structure import ARM, ERR, EV, MODE, MSG, PARM, QUIET_NAN, LogStructure
from ap_visualodom.log_structure import VISO, VISP, VISV
from ekf_stub.log.ekf_log_structure import XKF1, XKF3, XKF4
from viso.logs.logger import STRUCTURES
from viso.report.flight_data import Material, read_material

NAVIGATES: Final = 0x33F  # of XKF4.SS: everything, of which 8 and 16 are positions
LOST: Final = 0x0A7  # no position, constant position mode
VELOCITY: Final = 0x027  # a velocity alone
_BY_NAME: Final = {one.name: one for one in (ARM, ERR, EV, MODE, MSG, PARM, VISO, VISP, VISV, XKF1, XKF3, XKF4)}


class LogMaker:
    """Writes records, the oldest first, and reads them back.

    Fields that are not given are 0; VISP and VISV are stamped 20 ms before they are logged, with quality 80.
    """

    def __init__(self) -> None:
        self._writer = DataFlashWriter(STRUCTURES)
        self.data = b""

    def add(self, name: str, time_s: float, **fields: Any) -> None:
        """Write a record of a type that the firmware has."""
        self.add_to(_BY_NAME[name], time_s, **fields)

    def add_to(self, structure: LogStructure, time_s: float, **fields: Any) -> None:
        """Write a record of some type."""
        time_us = round(time_s * 1e6)
        defaults: dict[str, LogValue] = {"TimeUS": time_us}
        if structure.name in ("VISP", "VISV"):
            defaults |= {"RTimeUS": time_us, "CTimeMS": (time_us // 1000 - 20) % 2**32, "Q": 80}
        values = [fields.get(label, defaults.get(label, 0)) for label in structure.fields]
        self.data += self._writer.record(structure, values)

    def define(self, name: str, labels: str, format: str) -> LogStructure:
        """Return a type that the firmware does not have, or not any more."""
        self._writer = DataFlashWriter([one for one in STRUCTURES if one.name != name])
        return self._writer.define(name, labels, format)

    def parameter(self, name: str, value: float, default: float = math.nan, time_s: float = 1.0) -> None:
        """Write a PARM record; NaN is no default."""
        self.add("PARM", time_s, Name=name, Value=value, Default=QUIET_NAN if math.isnan(default) else default)

    def save(self, path: Path) -> Path:
        """Write the log to a file, and return its path."""
        path.write_bytes(self.data)
        return path


def flight(text: str = "Field Elevation Set: 584m") -> LogMaker:
    """Return a log of 12 s: along x = 0.5 m/s north, vision at 20 Hz, EKF at 10 Hz, armed from 3 s on.

    From 6 to 7 s vision has quality 5 and is withheld; from 8 to 8.6 s there is none; at 9 s it resets and moves by 2 m
    east, which the EKF follows after half a second of rejecting it.
    """
    maker = LogMaker()
    maker.add("MSG", 1.0, Message="ArduCopter V4.7.0-dev (00000000)")
    maker.add("MSG", 1.0, Message=text)
    for name, value, default in (
        ("VISO_TYPE", 1, 0), ("VISO_DELAY_MS", 30, 10), ("VISO_QUAL_MIN", 20, 0), ("EK3_SRC1_POSXY", 6, 3),
    ):  # fmt: skip
        maker.parameter(name, value, default)
    maker.add("MODE", 1.0, Mode=0, ModeNum=0, Rsn=26)
    steps: list[tuple[float, Callable[[], None]]] = []

    def at(time_s: float, name: str, fields: Mapping[str, Any]) -> None:
        steps.append((time_s, lambda: maker.add(name, time_s, **fields)))

    for number in range(20, 240):
        time_s = number * 0.05
        _vision_at(at, time_s)
        if number % 2 == 0:
            _ekf_at(at, time_s)
    at(3.0, "ARM", {"ArmState": 1})
    at(3.0, "MODE", {"Mode": 4, "ModeNum": 4})
    at(9.0, "MSG", {"Message": "VisOdom: reset"})
    for _, write in sorted(steps, key=lambda step: step[0]):
        write()
    return maker


def _vision_at(at: Callable[[float, str, Mapping[str, Any]], None], time_s: float) -> None:
    if 8.0 < time_s < 8.6:
        return
    low, reset = 6.0 <= time_s < 7.0, time_s >= 9.0
    common = {"Q": 5 if low else 80, "Ign": int(low), "Rst": int(reset)}
    position = {"PX": 0.5 * (time_s - 0.05), "PY": 2.0 * reset, "PZ": -1.0, "Y": 350.0}
    at(time_s, "VISP", {**position, "PErr": 0.2, "AErr": 0.1, **common})
    at(time_s, "VISV", {"VX": 0.5, "VErr": 0.1, **common})


def _ekf_at(at: Callable[[float, str, Mapping[str, Any]], None], time_s: float) -> None:
    moved, rejects = time_s >= 9.45, 8.95 <= time_s < 9.45
    status = {"SV": 0.1, "SP": 1.8 if rejects else 0.2, "SH": 0.05, "OFE": 2.0 * moved}
    at(time_s, "XKF4", {**status, "SS": NAVIGATES if time_s >= 2.0 else LOST})
    at(time_s, "XKF1", {"PN": 0.5 * time_s, "PE": 2.0 * moved, "PD": -1.0, "VN": 0.5, "Yaw": 350.0})
    at(time_s, "XKF3", {"IVN": 0.1, "IPE": -2.0 if rejects else 0.0})


def material_of(maker: LogMaker, path: Path) -> Material:
    """Return what the report reads of a log."""
    return read_material(maker.save(path), lambda _: None)
