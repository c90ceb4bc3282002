# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Logs of ordinary records, made up."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ap_core.dataflash import DataFlashWriter
from ap_core.dataflash_columns import LogColumns
from ap_core.log_structure import FMT, FMTU, MULT, PARM, UNIT

Array = npt.NDArray[np.float64]

_LAYOUTS = {
    "IMU": ("TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "QBffffff"),
    "GYR": ("TimeUS,I,SampleUS,GyrX,GyrY,GyrZ", "QBQfff"),
    "ACC": ("TimeUS,I,SampleUS,AccX,AccY,AccZ", "QBQfff"),
    "ATT": ("TimeUS,Roll,Pitch,Yaw", "Qfff"),
    "XKF1": ("TimeUS,C,VN,VE,VD,PN,PE,PD", "QBffffff"),
    "XKF2": ("TimeUS,C,MN,ME", "QBhh"),
    "XKF4": ("TimeUS,C,SS,PI", "QBHb"),
    "XKQ": ("TimeUS,C,Q1,Q2,Q3,Q4", "QBffff"),
    "POS": ("TimeUS,Lat,Lng,Alt", "QLLe"),
    "BARO": ("TimeUS,I,Alt,SMS", "QBfI"),
    "MAG": ("TimeUS,I,MagX,MagY,MagZ,S", "QBhhhI"),
    "ARM": ("TimeUS,ArmState", "QB"),
    "EV": ("TimeUS,Id", "QB"),
    "ORGN": ("TimeUS,Type,Lat,Lng,Alt", "QBLLe"),
    "GPS": ("TimeUS,I,Status,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ", "QBBBcLLefff"),
    "GPA": ("TimeUS,I,VDop,HAcc,VAcc,SAcc,VV,SMS", "QBCCCCBI"),
    "RGPI": ("Lg,I", "fB"),
    "RFRH": ("TimeUS", "Q"),
    "RSO3": ("Lat,Lng,Alt", "LLe"),
    "MSG": ("TimeUS,Message", "QZ"),
}

Rows = Iterable[Sequence[Any]]


def log_of(params: Mapping[str, float] | None = None, /, **rows: Rows) -> LogColumns:
    """Return a log of parameters, and of rows of fields by the type of record."""
    writer = DataFlashWriter((FMT, UNIT, FMTU, MULT, PARM))
    data = writer.start_up([(name, value, value) for name, value in (params or {}).items()], time_us=0)
    parts = [b"".join(data) if not isinstance(data, bytes) else data]
    for kind, of_kind in rows.items():
        layout = writer.define(kind, *_LAYOUTS[kind])
        for row in of_kind:
            values = [
                value if char == "Z" else int(value) if char in "QBHIhbLecC" else float(value)
                for value, char in zip(row, layout.format, strict=True)
            ]
            parts.append(writer.record(layout, values))
    return LogColumns(b"".join(parts))
