# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs the filter over the replay records of a log, beside the log's own estimates."""

import math
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from ap_core.cint import i16, int_of_float
from ap_core.dataflash_columns import LogColumns
from ap_core.location import Location
from ap_core.log_structure import ERR, EV, MSG, ORGN, QUIET_NAN
from ekf_stub.inputs.measurements import Array
from ekf_stub.log.ekf_log import PERIOD_US
from ekf_stub.log.ekf_log_structure import XKF1, XKF3, XKF4
from ekf_stub.reports import MAV_SEVERITY_WARNING, CoreReport
from viso.errors import InputError
from viso.firmware.flown import JudgedBy, profile_for, version_in
from viso.firmware.releases import Firmware
from viso.logs.event_names import ERR_EKF_PRIMARY, EV_SOURCE_SET_1, EV_YAW_RESET
from viso.logs.recorded import RecordError, finite, notes_of_lost, places_of, read_columns, records_in, text, whole
from viso.logs.vehicle_log import ORGN_EKF
from viso.parameters.left_out import left_out
from viso.replay.ekf.frames import Frames
from viso.replay.ekf.output import EkfOutput
from viso.replay.ekf.player import PLAYED, EkfPlayer

LABELS: Final = (
    *("Roll", "Pitch", "Yaw", "VN", "VE", "VD", "PN", "PE", "PD"),
    *("IVN", "IVE", "IVD", "IPN", "IPE", "IPD", "SV", "SP", "SH", "OFN", "OFE", "TS", "SS"),
)
"""The labels of XKF1, XKF3 and XKF4 that are compared; angles are in deg."""

FIELDS: Final[Mapping[str, str]] = {
    label: f"{structure.name}.{label}"
    for label in LABELS
    for structure in (XKF1, XKF3, XKF4)
    if label in structure.fields
}
"""The labels as ``RECORD.Label``."""

Texts = list[tuple[float, str]]
"""Texts, each with its time in s since boot."""

LANE_TEXTS: Final = ("EKF3 lane switch", "EKF primary changed")
_NO_REPLAY: Final = "no replay records; LOG_REPLAY was off, or the EKF was"
_COMPARED: Final = frozenset({"XKF1", "XKF3", "XKF4"})
_READ: Final = (*PLAYED, "MSG", "XKF1", "XKF3")
"""The types that are read record by record."""

_SOURCE_SET_EVENTS: Final = range(EV_SOURCE_SET_1, EV_SOURCE_SET_1 + 3)
_PROGRESS_FRAMES: Final = 1000


@dataclass(frozen=True)
class EkfReplay:
    """The estimates of a core by the filter and by the log, at the log's times.

    Attributes:
        time_s: the times since boot, shape (n,).
        ours, recorded: the estimates by label, shape (n,) each.
        our_texts, recorded_texts: the texts of the core, without the prefix that names it.
    """

    time_s: Array
    ours: dict[str, Array]
    recorded: dict[str, Array]
    our_texts: Texts
    recorded_texts: Texts

    def until(self, end_s: float) -> "EkfReplay":
        """Return the estimates and texts up to a time."""
        kept = self.time_s <= end_s
        return EkfReplay(
            self.time_s[kept],
            {label: values[kept] for label, values in self.ours.items()},
            {label: values[kept] for label, values in self.recorded.items()},
            until(self.our_texts, end_s),
            until(self.recorded_texts, end_s),
        )


def until(texts: Texts, end_s: float) -> Texts:
    """Return the texts up to a time."""
    return [entry for entry in texts if entry[0] <= end_s]


class NothingToCompare(InputError):
    """A file has no outputs to compare, such as a log without replay records or estimates."""


class _Row(NamedTuple):
    """The estimates at a time, by label."""

    time_s: float
    ours: dict[str, float]
    recorded: dict[str, float]


class EkfRun:
    """A run of the filter over a log (.BIN, packed or not).

    Args:
        until_s: end time since boot.
        core: the number of the core to run, None for all.
        firmware: the release of the filter; None for the one nearest to the release that wrote the log.

    Attributes:
        judged_by: the release, and how it was found; None before it is known.
        frames: the number of frames that have been run.
        output: the filter's log.
        notes: what the log lost, and its parameters that have no effect here, a line each.
        our_lanes, recorded_lanes: the texts of changes of the primary core.
    """

    def __init__(
        self,
        path: Path,
        *,
        until_s: float = math.inf,
        core: int | None = None,
        firmware: Firmware | None = None,
    ) -> None:
        self._path = path
        self._until_s = until_s
        self._core = core
        self._given = firmware
        self.judged_by: JudgedBy | None = None
        self._defaults: dict[str, float] = {}
        self._player: EkfPlayer | None = None
        self.output = EkfOutput(lambda: self._playing.primary)
        self._rows: defaultdict[int, list[_Row]] = defaultdict(list)
        self._our_texts: defaultdict[int, Texts] = defaultdict(list)
        self._recorded_texts: defaultdict[int, Texts] = defaultdict(list)
        self.notes: tuple[str, ...] = ()
        self.our_lanes: Texts = []
        self.recorded_lanes: Texts = []
        self._yaw_reset_ms = 0
        self._primary = core or 0  # as Copter begins, unless there is only one core
        self._has_estimates = False
        self._next_us = 0

    @property
    def _playing(self) -> EkfPlayer:
        assert self._player is not None
        return self._player

    @property
    def imus(self) -> dict[int, int]:
        """The IMU of each core that is run, by the core's number."""
        return {} if self._player is None else self._player.imus

    @property
    def frames(self) -> int:
        """The number of frames that have been run."""
        return 0 if self._player is None else self._player.next_frame

    @property
    def _time_us(self) -> int:
        return 0 if self._player is None else self._player.time_us

    @property
    def time_s(self) -> float:
        """The time since boot that the run has reached."""
        return self._time_us / 1e6

    def run(self, on_progress: Callable[[int, int], None] = lambda _frames, _all: None) -> None:
        """Run to the end.

        Args:
            on_progress: takes the number of frames so far and of all, a few times per second.

        Raises:
            NothingToCompare: the log has no replay records.
            InputError: the log cannot be read, or the filter cannot be run over it.
        """
        log = read_columns(self._path)
        if not log.counts.get("RFRH"):
            raise NothingToCompare(f"{self._path}: {_NO_REPLAY}")
        try:
            self._play(log, on_progress)
        except RecordError as error:
            raise InputError(f"{self._path}: {error} (at {self.time_s:.3f} s)") from error
        if self._playing.lanes is None:
            raise InputError(f"{self._path}: {_NO_REPLAY}")

    def _play(self, log: LogColumns, on_progress: Callable[[int, int], None]) -> None:
        self.notes = tuple(notes_of_lost(log))
        frames = Frames(log, self._until_s * 1e6)
        player = self._player = EkfPlayer(self, frames, self._core)
        self._has_estimates = bool(log.counts.get("XKF4"))
        self.judged_by = recorded_firmware(log, self._given)
        player.release = self.judged_by.firmware.ekf
        self._choose_first_source_set(log, int(frames.begins[0]) if len(frames) else 0)
        shown = 0
        problem = frames.problem()
        places = places_of(log, _READ)
        times_us = np.append(0, frames.begin_times_us)[np.searchsorted(frames.begins, places)].tolist()
        for place, time_us, record in zip(places.tolist(), times_us, records_in(log, _READ), strict=True):
            if place >= frames.end or (problem is not None and place > problem[0]):
                break
            self._run_until(place)
            if frames.begins[0] < place:
                player.time_us = max(time_us, player.time_us)
                self._begin_output()
            self._take(record)
            if player.next_frame - shown >= _PROGRESS_FRAMES:
                shown = player.next_frame
                on_progress(shown, len(frames))
        self._run_until(frames.end if problem is None else problem[0])
        if problem is not None and problem[0] < frames.end:
            begun = np.searchsorted(frames.begins, problem[0], side="right") - 1
            player.time_us = max(player.time_us, int(frames.begin_times_us[begun]))
            raise problem[1]

    def _choose_first_source_set(self, log: LogColumns, begin: int) -> None:
        """Choose the set of sources that a switch of the transmitter chose before the replay records begin."""
        for place, record in zip(places_of(log, ["EV"]), records_in(log, ["EV"]), strict=True):
            (event,) = whole(record, "Id")
            if place < begin and event in _SOURCE_SET_EVENTS:
                self._playing.choose_source_set(_SOURCE_SET_EVENTS.index(event))

    def _run_until(self, place: int) -> None:
        """Run the frames that come before a place in the log; write estimates where the log has none of its own."""
        player = self._playing
        if self._has_estimates:
            player.run_until(place, math.inf)
            return
        before = -1
        while before != player.next_frame:
            before = player.next_frame
            player.run_until(place, self._next_us)
            if player.lanes is not None and player.next_frame > before and player.time_us >= self._next_us:
                self._next_us = player.time_us + PERIOD_US
                self._write_estimates()

    def comparison(self, core: int = 0) -> EkfReplay | None:
        """Return the estimates of a core; None if the log has none of it."""
        rows = [row for row in self._rows[core] if len(row.recorded) == len(LABELS)]
        if not rows:
            return None
        return EkfReplay(
            np.array([row.time_s for row in rows]),
            {label: np.array([row.ours[label] for row in rows]) for label in LABELS},
            {label: np.array([row.recorded[label] for row in rows]) for label in LABELS},
            self._our_texts[core],
            self._recorded_texts[core],
        )

    # Records

    def _take(self, record: Any) -> None:
        kind = record.get_type()
        if kind == "PARM":
            self._playing.take(record)
            self._take_parm(record)
        elif kind == "MSG":
            self._take_text(record)
        elif kind in _COMPARED:
            if whole(record, "C")[0] in self.imus:
                self._take_estimates(record)
        else:
            self._playing.take(record)

    def _begin_output(self) -> None:
        if self.output.is_empty:
            params = self._playing.params
            rows = ((name, value, self._defaults[name]) for name, value in params.items())
            self.output.begin(rows, self._time_us)
            effectless = left_out(params)
            self.notes += effectless
            for note in effectless:
                self.output.write(MSG, (self._time_us, note))

    def passed(self) -> None:
        """Log the records of the cores, and the vehicle's events about them."""
        self._begin_output()
        for number, core in self._playing.cores.items():
            self.output.passed(number, core, self._time_us)
        self._note_jumps()

    def _write_estimates(self) -> None:
        for number in self.imus:
            self.output.estimates(number, self._playing.report(number), self._time_us)

    def _note_jumps(self) -> None:
        """Log the vehicle's events about resets of its estimator (Copter::check_ekf_reset)."""
        lanes, now_us = self._playing.lanes, self._time_us
        if lanes is None:
            return
        if lanes.yaw_reset_ms > self._yaw_reset_ms:
            self.output.write(EV, (now_us, EV_YAW_RESET))
        self._yaw_reset_ms = lanes.yaw_reset_ms
        if lanes.primary_filter.initialised and self._playing.primary != self._primary:
            self._primary = self._playing.primary
            self.output.write(ERR, (now_us, ERR_EKF_PRIMARY, self._primary))
            self.send_text(MAV_SEVERITY_WARNING, f"EKF primary changed:{self._primary}")

    def _take_parm(self, record: Any) -> None:
        name, default = text(record, "Name"), getattr(record, "Default", None)  # logs of older releases have none
        self._defaults[name] = default if isinstance(default, float) else float(QUIET_NAN)
        if not self.output.is_empty:
            self.output.parameter(name, self._playing.params[name], self._time_us)

    def _take_text(self, record: Any) -> None:
        message = text(record, "Message")
        (time_us,) = whole(record, "TimeUS")
        self._sort_text(time_us / 1e6, message.rstrip(), self._recorded_texts, self.recorded_lanes)

    def _sort_text(self, time_s: float, message: str, by_core: defaultdict[int, Texts], lanes: Texts) -> None:
        if message.startswith(LANE_TEXTS):
            lanes.append((time_s, message))
        for number, imu in self.imus.items():
            prefix = f"EKF3 IMU{imu} "
            if message.startswith(prefix):
                by_core[number].append((time_s, message.removeprefix(prefix)))

    def _take_estimates(self, record: Any) -> None:
        time_us, number = whole(record, "TimeUS", "C")
        rows, core = self._rows[number], self._playing.cores.get(number)
        if record.get_type() == "XKF4":
            if number == next(iter(self.imus)):
                self._write_estimates()
            if core is not None and core.initialised:
                rows.append(_Row(time_us / 1e6, _ours(self._playing.report(number)), {}))
        if rows and rows[-1].time_s == time_us / 1e6:
            labels = [label for label in LABELS if hasattr(record, label)]
            rows[-1].recorded.update(zip(labels, finite(record, *labels), strict=True))

    # Texts and events of the filter

    def send_text(self, _severity: int, message: str) -> None:
        """Note and log a text."""
        self.output.write(MSG, (self._time_us, message))
        self._sort_text(self.time_s, message, self._our_texts, self.our_lanes)

    def source_set(self, index: int) -> None:
        """Log that a source set was chosen."""
        self.output.write(EV, (self._time_us, EV_SOURCE_SET_1 + index))

    def origin(self, place: Location) -> None:
        """Log the origin that was set."""
        self.output.write(ORGN, (self._time_us, ORGN_EKF, place.lat, place.lng, place.alt_cm))


def recorded_firmware(log: LogColumns, given: Firmware | None = None) -> JudgedBy:
    """Return the release to judge a log by; ``given`` is the one that the user asks for."""
    messages = (text(record, "Message") for record in records_in(log, ["MSG"]))
    flown = next((version for message in messages if (version := version_in(message)) is not None), None)
    return profile_for(flown, {text(record, "Name") for record in records_in(log, ["PARM"])}, given)


def _held(ratio: float) -> float:
    """Return what XKF4 holds of a ratio: the low 16 bits of its hundredths, if they need more."""
    hundredths = int_of_float(100 * ratio)
    return ratio if hundredths == i16(hundredths) else i16(hundredths) / 100


def _ours(report: CoreReport) -> dict[str, float]:
    """Return the estimates by label: positions in single precision, and ratios of which the log holds a part, as it."""
    north, east, down = (float(np.float32(coordinate)) for coordinate in report.pos_ned)
    roll, pitch, yaw = map(math.degrees, report.rpy_rad)
    values = (
        *(roll, pitch, yaw % 360, *report.vel_ned, north, east, down, *report.vel_innovation, *report.pos_innovation),
        *(_held(math.sqrt(ratio)) for ratio in (report.vel_ratio, report.pos_ratio, report.height_ratio)),
        *(*report.moved_ne, report.timeouts, report.flags),
    )
    return dict(zip(LABELS, values, strict=True))
