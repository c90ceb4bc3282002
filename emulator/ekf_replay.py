# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the filter over the replay records of a log, beside the estimates that the log holds.

A log has them when it was written with LOG_REPLAY: each frame's inertial data and sensors, and every call by which
external navigation came in. Source of the order: AP_DAL/AP_DAL.cpp.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ap_core.quaternion import Quaternion
from ap_core.vector3 import Vector3f
from ekf_stub.core_texts import CoreTexts
from ekf_stub.ekf3_core import Ekf3Core, Frame
from ekf_stub.error_state import euler_of
from ekf_stub.inertial import Array, InertialDelta
from ekf_stub.obs_ring import ring_sizes
from ekf_stub.sources import EkfSources
from emulator.errors import InputError
from emulator.recorded_log import read_log

LABELS: Final = (
    *("Roll", "Pitch", "Yaw", "VN", "VE", "VD", "PN", "PE", "PD"),
    *("IVN", "IVE", "IVD", "IPN", "IPE", "IPD", "SV", "SP", "SH", "OFN", "OFE", "TS", "SS"),
)
"""What is compared, by the labels of XKF1, XKF3 and XKF4; angles in deg."""

MAX_DELAY_MS: Final = 250
MAG_DELAY_MS: Final = 60
_CORE: Final = 0
_IMU: Final = 0
_EKF3_RUNS: Final = 4 | 8  # of RFRF.FTypes
_ARMED, _TAKEOFF_EXPECTED, _TOUCHDOWN_EXPECTED = 1, 64, 128  # of RFRN.Flags
_RESET_HEIGHT_DATUM: Final = 1  # of REV3
_TEXT_PREFIX: Final = "EKF3 IMU0 "


@dataclass(frozen=True)
class EkfReplay:
    """What the filter and the log say at the log's times.

    Attributes:
        time_s: shape (n,), since boot.
        ours, recorded: shape (n,) each, by label.
        our_texts, recorded_texts: times in s, and texts of the first core without their beginning.
    """

    time_s: Array
    ours: dict[str, npt.NDArray[np.float64]]
    recorded: dict[str, npt.NDArray[np.float64]]
    our_texts: list[tuple[float, str]]
    recorded_texts: list[tuple[float, str]]


@dataclass
class _Texts:
    now_s: Callable[[], float]
    sent: list[tuple[float, str]] = field(default_factory=list)

    def send_text(self, _severity: int, text: str) -> None:
        self.sent.append((self.now_s(), text.removeprefix(_TEXT_PREFIX)))


class _Player:
    """Takes records in the order of the log."""

    def __init__(self) -> None:
        self._params: dict[str, float] = {}
        self._core: Ekf3Core | None = None
        self._now_us = self._flying_ms = self._flags = 0
        self._declination = 0.0
        self._delta: InertialDelta | None = None
        self._baro: tuple[int, float] | None = None
        self._mag: tuple[int, Array] | None = None
        self.texts = _Texts(lambda: self._now_us / 1e6)
        self.recorded_texts: list[tuple[float, str]] = []
        self.rows: list[tuple[float, dict[str, float], dict[str, float]]] = []

    def take(self, record: Any) -> None:
        handler = getattr(self, f"_take_{record.get_type().lower()}", None)
        if handler is not None:
            handler(record)

    def _take_parm(self, record: Any) -> None:
        self._params[record.Name] = record.Value

    def _take_msg(self, record: Any) -> None:
        if record.Message.startswith(_TEXT_PREFIX):
            self.recorded_texts.append((record.TimeUS / 1e6, record.Message.removeprefix(_TEXT_PREFIX)))

    def _take_rfrh(self, record: Any) -> None:
        self._now_us, self._flying_ms = record.TimeUS, record.TF

    def _take_rfrn(self, record: Any) -> None:
        self._flags = record.Flags

    def _take_rmgh(self, record: Any) -> None:
        self._declination = record.Dec

    def _take_risi(self, record: Any) -> None:
        if record.I == _IMU:
            del_vel, del_ang = (record.DVX, record.DVY, record.DVZ), (record.DAX, record.DAY, record.DAZ)
            self._delta = InertialDelta(np.array(del_vel), np.array(del_ang), record.DVDT, record.DADT)

    def _take_rbri(self, record: Any) -> None:
        if record.I == _IMU:
            self._baro = record.LastUpdate, record.Alt

    def _take_rmgi(self, record: Any) -> None:
        if record.I == _IMU:
            self._mag = record.LU, np.array([record.FX, record.FY, record.FZ])

    def _take_rfrf(self, record: Any) -> None:
        if self._delta is None or not record.FTypes & _EKF3_RUNS:
            return
        if self._core is None:
            self._core = self._make_core()
        self._core.run(
            Frame(
                self._now_us,
                self._delta,
                armed=bool(self._flags & _ARMED),
                flying_ms=self._flying_ms,
                takeoff_expected=bool(self._flags & _TAKEOFF_EXPECTED),
                touchdown_expected=bool(self._flags & _TOUCHDOWN_EXPECTED),
                baro=self._baro,
                mag=self._mag,
                declination=self._declination,
                lever_arm=(self._param("VISO_POS_X"), self._param("VISO_POS_Y"), self._param("VISO_POS_Z")),
            )
        )

    def _param(self, name: str) -> float:
        try:
            return self._params[name]
        except KeyError:
            raise InputError(f"no parameter {name}") from None

    def _make_core(self) -> Ekf3Core:
        delays_ms = (self._param("EK3_HGT_DELAY"), min(self._param("VISO_DELAY_MS"), MAX_DELAY_MS), MAG_DELAY_MS)
        return Ekf3Core(
            EkfSources(lambda name: int(self._param(f"EK3_{name}"))),
            lambda name: self._param(f"EK3_{name}"),
            ring_sizes(int(max(delays_ms))),
            CoreTexts(self.texts, (_CORE,)),
            Counter(),
            lambda: self._mag is not None,
        )

    def _take_reph(self, record: Any) -> None:
        if self._core is not None:
            pos, quat = (record.PX, record.PY, record.PZ), (record.Q1, record.Q2, record.Q3, record.Q4)
            errors = np.float32(record.PEr), np.float32(record.AEr)
            self._core.ingest.write_pose(Vector3f(*pos), Quaternion(*quat), errors, record.TS, record.D, record.RT)

    def _take_revh(self, record: Any) -> None:
        if self._core is not None:
            vel = Vector3f(record.VX, record.VY, record.VZ)
            self._core.ingest.write_velocity(vel, np.float32(record.Er), record.TS, record.D)

    def _take_rso3(self, record: Any) -> None:
        if self._core is not None:
            self._core.set_origin(record.Alt)

    def _take_rev3(self, record: Any) -> None:
        if self._core is not None and record.Event == _RESET_HEIGHT_DATUM:
            self._core.reset_height_datum()

    def _take_xkf4(self, record: Any) -> None:
        core = self._core
        if record.C != _CORE or core is None or not core.initialised:
            return
        self.rows.append((self._now_us / 1e6, _ours(core, self._now_us // 1000), {}))
        self._note(record)

    def _take_xkf1(self, record: Any) -> None:
        self._note(record)

    def _take_xkf3(self, record: Any) -> None:
        self._note(record)

    def _note(self, record: Any) -> None:
        if record.C == _CORE and self.rows:
            self.rows[-1][2].update({label: getattr(record, label) for label in LABELS if hasattr(record, label)})


def _ours(core: Ekf3Core, now_ms: int) -> dict[str, float]:
    output, innovations = core.output.now, core.fusion.innovations
    roll, pitch, yaw = (math.degrees(angle) for angle in euler_of(output.quat))
    ratios = (innovations.vel_ratio, innovations.pos_ratio, innovations.height_ratio)
    values = (
        *(roll, pitch, yaw % 360, *output.vel, *core.position(), *innovations.vel, *innovations.pos),
        *(math.sqrt(ratio) for ratio in ratios),
        *core.resets.moved_ne,
        *(core.timeouts(now_ms), core.flags),
    )
    return dict(zip(LABELS, map(float, values), strict=True))


def replay_ekf(path: Path, *, until_s: float = math.inf) -> EkfReplay:
    """Run the filter over a log, up to a time since boot.

    Raises:
        InputError: the log cannot be read, or has no replay records.
    """
    player = _Player()

    def play(log: Any) -> None:
        while (record := log.recv_msg()) is not None:
            if record.get_type() == "RFRH" and record.TimeUS > until_s * 1e6:
                break
            player.take(record)

    read_log(path, play)
    rows = [row for row in player.rows if len(row[2]) == len(LABELS)]
    if not rows:
        raise InputError(f"{path}: no replay records; LOG_REPLAY was off, or the EKF was")
    return EkfReplay(
        np.array([time_s for time_s, _, _ in rows]),
        {label: np.array([ours[label] for _, ours, _ in rows]) for label in LABELS},
        {label: np.array([recorded[label] for _, _, recorded in rows]) for label in LABELS},
        player.texts.sent,
        [entry for entry in player.recorded_texts if entry[0] <= until_s],
    )
