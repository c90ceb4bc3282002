# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The data of flow sensors and range finders in a recording, and the vehicle's motion to compare them with."""

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np

from ap_core.dataflash_columns import LogColumns
from ap_core.fmath import FLT_EPSILON
from ekf_stub.inputs.measurements import DOWNWARD, RangeStatus
from mav_handlers.verdicts import UNREAD_FLOW
from mav_handlers.wire.codec import Header
from mav_handlers.wire.messages import ATTITUDE, DISTANCE_SENSOR, LOCAL_POSITION_NED, OPTICAL_FLOW, SYS_STATUS, Message
from viso.doctor.evidence.tracks import Bools, Floats, Ints
from viso.estimators.series import rows_in_time
from viso.logs.filter_records import table_with
from viso.logs.recorded import table_of
from viso.streams.heard import MAV_COMP_ID_AUTOPILOT1

LONGEST_PERIOD_S: Final = 0.5
"""After a longer silence AP_OpticalFlow_MAV takes a flow for zero."""

FLOW: Final = "flow sensor"
RANGE: Final = "range finder"
_BITS: Final = ((FLOW, 1 << 6), (RANGE, 1 << 8))
"""Of MAV_SYS_STATUS_SENSOR: OPTICAL_FLOW and LASER_POSITION."""

_FRAMES: Final = 20
"""Of a log, from one range to the next: the filter looks at them 20 times per second."""

_FINDERS: Final = "123456789A"
_MAVLINK: Final = 10


class RangeFinder(NamedTuple):
    """The parameters of a range finder: its number from 1 (A for 10), RNGFNDn_TYPE and RNGFNDn_ORIENT."""

    number: str
    kind: int
    orient: int

    @property
    def is_mavlink(self) -> bool:
        """Whether it takes DISTANCE_SENSOR."""
        return self.kind == _MAVLINK


def finders_in(params: Mapping[str, float]) -> list[RangeFinder]:
    """Return the range finders that parameters set up."""
    known = {name: int(value) for name, value in params.items() if name.startswith("RNGFND") and math.isfinite(value)}
    return [
        RangeFinder(number, kind, known.get(f"RNGFND{number}_ORIENT", DOWNWARD))
        for number in _FINDERS
        if (kind := known.get(f"RNGFND{number}_TYPE", 0))
    ]


@dataclass(frozen=True, slots=True, eq=False)
class FlowSeries:
    """The data of a flow sensor.

    Attributes:
        origin: the record or message, such as OF.
        time_us: N, us since boot.
        rate: N x 2, rad/s about the body's x and y, as the autopilot has them.
        body: N x 2, rad/s, the rates of the sensor's own gyro; NaN where they are not known.
        quality: N, 0 to 255.
        numbers: of the messages, from 1; empty of a log.
        units: N x 2, flow_x and flow_y as a companion sent them; None if the autopilot reports its rates.
        sent_rate: N x 2, rad/s, flow_rate_x and flow_rate_y as a companion sent them.
        takes_sent_rate: N, whether the autopilot takes these; else it takes ``units`` times the period.
        has_all: whether every measurement is there, as it is not in the autopilot's telemetry.
    """

    origin: str
    time_us: Ints
    rate: Floats
    body: Floats
    quality: Ints
    numbers: Ints
    units: Floats | None = None
    sent_rate: Floats | None = None
    takes_sent_rate: Bools = field(default_factory=lambda: np.zeros(0, np.bool_))
    has_all: bool = True

    def __len__(self) -> int:
        return len(self.time_us)


@dataclass(frozen=True, slots=True, eq=False)
class UnreadFlow:
    """A sender's messages of one type of ``UNREAD_FLOW``: N times in us since boot, and N numbers, from 1."""

    origin: str
    time_us: Ints
    numbers: Ints

    def __len__(self) -> int:
        return len(self.time_us)


@dataclass(frozen=True, slots=True, eq=False)
class RangeSeries:
    """The data of a range finder.

    Attributes:
        origin: the record or message, such as RFND.
        instance: its number, from 0.
        time_us: N, us since boot.
        dist_m: N.
        low_m, high_m: N, what it can measure; NaN where it is not known.
        status: N, of ``RangeStatus``.
        orient: N, where it looks, 25 for down.
        numbers: of the messages, from 1; empty of a log.
        is_sent: whether a companion sends it: the autopilot may not take it.
    """

    origin: str
    instance: int
    time_us: Ints
    dist_m: Floats
    low_m: Floats
    high_m: Floats
    status: Ints
    orient: Ints
    numbers: Ints
    is_sent: bool = False

    def __len__(self) -> int:
        return len(self.time_us)

    @property
    def is_good(self) -> Bools:
        """N, whether the status lets the filter use the distance."""
        return np.asarray(self.status == RangeStatus.GOOD, dtype=np.bool_)

    @property
    def looks_down(self) -> bool:
        """Whether it looks down, by its last record."""
        return bool(self.orient[-1] == DOWNWARD)


def _none(width: int) -> Floats:
    return np.zeros((0, width))


@dataclass(frozen=True, slots=True, eq=False)
class GroundSensors:
    """Flow and ranges, and the vehicle's motion.

    Attributes:
        flows, ranges: of all sensors.
        turning: M x 4, us and the vehicle's body rates in rad/s.
        velocity: M x 3, us and the filter's velocity north and east in m/s.
        check: M x 3, us, the filter's worse test ratio of flow, 1 at the gate, and its height above the ground in m.
        by: whose motion that is.
        health: whether SYS_STATUS ever calls FLOW and RANGE healthy, if it enables them.
        unread: flow in messages that the autopilot does not read.
    """

    flows: tuple[FlowSeries, ...] = ()
    ranges: tuple[RangeSeries, ...] = ()
    turning: Floats = field(default_factory=lambda: _none(4))
    velocity: Floats = field(default_factory=lambda: _none(3))
    check: Floats = field(default_factory=lambda: _none(3))
    by: str = "the vehicle"
    health: Mapping[str, bool] = field(default_factory=dict)
    unread: tuple[UnreadFlow, ...] = ()

    def beside(self, other: "GroundSensors") -> "GroundSensors":
        """Return these sensors and those of another recording, with that one's motion of the vehicle if it has any."""
        return GroundSensors(
            (*other.flows, *self.flows),
            (*other.ranges, *self.ranges),
            other.turning if len(other.turning) else self.turning,
            other.velocity if len(other.velocity) else self.velocity,
            other.check if len(other.check) else self.check,
            health=self.health,
            unread=self.unread,
        )


NO_GROUND_SENSORS: Final = GroundSensors()


def ground_sensors_in(log: LogColumns) -> GroundSensors:
    """Return the flow and range data of a log."""
    check = rows_in_time(table_with(log, "XKF5", (("NI",), ("HAGL",))))
    check[:, 1] /= 100.0
    return GroundSensors(
        _logged_flow(log),
        _logged_ranges(log),
        _of_first(log, "IMU", "I", ("GyrX", "GyrY", "GyrZ")),
        _of_first(log, "XKF1", "C", ("VN", "VE")),
        check,
    )


def _of_first(log: LogColumns, kind: str, index: str, labels: tuple[str, ...]) -> Floats:
    """Return times and fields of the records of the first sensor or core."""
    table = rows_in_time(table_with(log, kind, ((index,), *((label,) for label in labels))))
    table = np.delete(table[np.nan_to_num(table[:, 1]) == 0], 1, axis=1)
    return np.asarray(table[np.isfinite(table).all(axis=1)], dtype=np.float64)


def _logged_flow(log: LogColumns) -> tuple[FlowSeries, ...]:
    """Return the OF records, or else what the filter was handed, which has the times of measurement."""
    origin, rows = "OF", table_with(log, "OF", (("Qual",), ("flowX",), ("flowY",), ("bodyX",), ("bodyY",)))
    if not len(rows):
        origin, rows = "ROFH", _handed_over(log)
    rows = rows_in_time(rows)
    if not len(rows):
        return ()
    quality = np.nan_to_num(rows[:, 1]).astype(np.int64)
    no_numbers = np.zeros(0, np.int64)
    return (FlowSeries(origin, rows[:, 0].astype(np.int64), rows[:, 2:4], rows[:, 4:6], quality, no_numbers),)


def _handed_over(log: LogColumns) -> Floats:
    """Return us, quality, flow and body rates of ROFH records, which have no TimeUS."""
    labels = ("Tms", "Qual", "FX", "FY", "GX", "GY")
    if not log.counts.get("ROFH") or not {*labels} <= {*log.types["ROFH"].labels}:
        return _none(len(labels))
    rows = table_of(log, "ROFH", labels)
    rows[:, 0] *= 1e3
    return rows


def _logged_ranges(log: LogColumns) -> tuple[RangeSeries, ...]:
    """Return the RFND records, or else what the filter was handed; without a status a distance above 0 is good."""
    labels = (("Instance", "I"), ("Dist", "Dist1"), ("Stat",), ("Orient", "Orient1"))
    origin = "RFND" if log.counts.get("RFND") else "RRNI"
    rows = rows_in_time(table_with(log, "RFND", labels) if origin == "RFND" else _given(log))
    rows = rows[np.isfinite(rows[:, [2, 4]]).all(axis=1)]
    status = np.where(rows[:, 2] > 0, float(RangeStatus.GOOD), float(RangeStatus.NO_DATA))
    rows[:, 3] = np.where(np.isfinite(rows[:, 3]), rows[:, 3], status)
    rows[:, 1] = np.nan_to_num(rows[:, 1])
    found = []
    for instance in np.unique(rows[:, 1]).astype(int).tolist():
        mine = rows[rows[:, 1] == instance]
        unknown = np.full(len(mine), np.nan)
        time_us, status, orient = mine[:, [0, 3, 4]].astype(np.int64).T
        no_numbers = np.zeros(0, np.int64)
        found.append(RangeSeries(origin, instance, time_us, mine[:, 2], unknown, unknown, status, orient, no_numbers))
    return tuple(found)


def _given(log: LogColumns) -> Floats:
    """Return us, instance, distance, status and orientation of RRNI records, which are written when one changes."""
    labels = ("I", "Dist", "Status", "Orient")
    if not (log.counts.get("RRNI") and log.counts.get("RFRH")) or not {*labels} <= {*log.types["RRNI"].labels}:
        return _none(1 + len(labels))
    frames, time_us = log.offsets("RFRH")[::_FRAMES], table_of(log, "RFRH", ("TimeUS",))[::_FRAMES]
    rows, begins, found = table_of(log, "RRNI", labels), log.offsets("RRNI"), []
    if not np.issubdtype(log.columns("RRNI", ["Dist"])["Dist"].dtype, np.floating):
        rows[:, 1] *= 0.01  # up to 4.6 they are whole centimetres
    for instance in np.unique(rows[:, 0]).tolist():
        mine = rows[:, 0] == instance
        latest = np.searchsorted(begins[mine], frames, side="right") - 1
        found.append(np.column_stack([time_us, rows[mine][latest]])[latest >= 0])
    return np.concatenate(found)


class GroundListener:
    """Collects flow, ranges and the motion of one vehicle from a stream."""

    MESSAGES: Final = ("OPTICAL_FLOW", *UNREAD_FLOW, "DISTANCE_SENSOR", "ATTITUDE", "SYS_STATUS", "LOCAL_POSITION_NED")

    def __init__(self) -> None:
        self._flows: dict[tuple[int, int], list[tuple[int, int, OPTICAL_FLOW]]] = defaultdict(list)
        self._ranges: dict[tuple[int, int, int, int], list[tuple[int, int, DISTANCE_SENSOR]]] = defaultdict(list)
        self._turning: dict[int, list[tuple[float, ...]]] = defaultdict(list)
        self._velocity: dict[int, list[tuple[float, ...]]] = defaultdict(list)
        self._health: dict[int, dict[str, bool]] = defaultdict(dict)
        self._unread: dict[tuple[int, int, str], list[tuple[int, int]]] = defaultdict(list)

    def take(self, time_us: int, number: int, header: Header, message: Message | None) -> None:
        """Take a message, by its time in us since boot and its number in the stream, from 1."""
        sender = header.system_id, header.component_id
        if isinstance(message, OPTICAL_FLOW):
            self._flows[sender].append((time_us, number, message))
        elif header.name in UNREAD_FLOW:
            self._unread[(*sender, header.name)].append((time_us, number))
        elif isinstance(message, DISTANCE_SENSOR):
            whose = *sender, message.id, message.orientation
            self._ranges[whose].append((time_us, number, message))
        elif header.component_id != MAV_COMP_ID_AUTOPILOT1:
            return
        elif isinstance(message, ATTITUDE):
            rates = message.rollspeed, message.pitchspeed, message.yawspeed
            self._turning[header.system_id].append((time_us, message.time_boot_ms * 1e3, *rates))
        elif isinstance(message, SYS_STATUS):
            enabled, healthy = message.onboard_control_sensors_enabled, message.onboard_control_sensors_health
            health = self._health[header.system_id]
            health.update(
                {name: health.get(name, False) or bool(healthy & bit) for name, bit in _BITS if enabled & bit}
            )
        elif isinstance(message, LOCAL_POSITION_NED):
            speeds = message.vx, message.vy
            self._velocity[header.system_id].append((time_us, message.time_boot_ms * 1e3, *speeds))

    def sensors(self, system_id: int | None, params: Mapping[str, float], reads_flow_rates: bool) -> GroundSensors:
        """Return what was collected.

        Args:
            system_id: the autopilot's; None if none is heard.
            params: the autopilot's, which scale and rotate what a companion sends.
            reads_flow_rates: whether the autopilot's release reads flow_rate_x and flow_rate_y.
        """
        own = (system_id, MAV_COMP_ID_AUTOPILOT1)
        vehicle = -1 if system_id is None else system_id
        return GroundSensors(
            tuple(
                _own_flow(who, rows) if who == own else _sent_flow(who, rows, params, reads_flow_rates)
                for who, rows in self._flows.items()
            ),
            tuple(_sent_range(who, rows, params, is_own=who[:2] == own) for who, rows in self._ranges.items()),
            _steady(self._turning[vehicle], 4),
            _steady(self._velocity[vehicle], 3),
            health=self._health[vehicle],
            unread=tuple(
                UnreadFlow(f"{name} from {system}/{component}", *np.array(rows, dtype=np.int64).T)
                for (system, component, name), rows in self._unread.items()
                if (system, component) != own
            ),
        )


def _steady(rows: list[tuple[float, ...]], width: int) -> Floats:
    """Return rows with times by their own clock, tied to the times of arrival by the least delay."""
    table = np.array(rows, dtype=np.float64).reshape(-1, width + 1)
    table = table[np.isfinite(table).all(axis=1)]
    if not len(table):
        return _none(width)
    table[:, 1] += np.min(table[:, 0] - table[:, 1])
    return np.asarray(table[np.argsort(table[:, 1], kind="stable"), 1:], dtype=np.float64)


def takes_rates(sent_rate: Floats) -> Bools:
    """Return of which messages a release that reads flow_rate_x and flow_rate_y takes them (N of N x 2).

    It does so from the first one on that is not zero (AP_OpticalFlow_MAV::handle_msg).
    """
    return np.asarray(np.logical_or.accumulate(~(np.abs(sent_rate) < FLT_EPSILON).all(axis=1)), dtype=np.bool_)


def rates_by_driver(
    units: Floats, sent_rate: Floats, takes_sent_rate: Bools, time_us: Ints, params: Mapping[str, float]
) -> Floats:
    """Return the rates that AP_OpticalFlow_MAV computes from messages that come one at a time.

    Args:
        units: N x 2, flow_x and flow_y as sent.
        sent_rate: N x 2, flow_rate_x and flow_rate_y as sent.
        takes_sent_rate: N, whether these are taken, as they are; else ``units`` are, times the period.
        time_us: N, when they came.
        params: with FLOW_FXSCALER, FLOW_FYSCALER and FLOW_ORIENT_YAW; 0 if they are missing.

    Source: AP_OpticalFlow_MAV::update.
    """
    dt = np.diff(time_us, prepend=time_us[:1] - int(1e6)) * 1e-6
    regular = (dt > 0) & (dt < LONGEST_PERIOD_S)
    factors = [1 + 0.001 * float(params.get(f"FLOW_F{axis}SCALER", 0.0)) for axis in "XY"]
    taken = np.where(takes_sent_rate[:, None], sent_rate, dt[:, None] * units)
    rates = np.where(regular[:, None], taken, 0.0) * np.array(factors)
    angle = np.radians(0.01 * float(params.get("FLOW_ORIENT_YAW", 0.0)))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return np.asarray(rates @ turn.T, dtype=np.float64)


_Rows = list[tuple[int, int, OPTICAL_FLOW]]
"""Times in us, numbers and messages."""


def _own_flow(whose: tuple[int, int], rows: _Rows) -> FlowSeries:
    """Return the autopilot's own telemetry of flow."""
    time_us, numbers, quality, sent = _columns(rows)
    body = sent - np.array([(one.flow_comp_m_x, one.flow_comp_m_y) for *_, one in rows], dtype=np.float64)
    return FlowSeries(_origin(whose), time_us, sent, body, quality, numbers, has_all=False)


def _sent_flow(whose: tuple[int, int], rows: _Rows, params: Mapping[str, float], reads_rates: bool) -> FlowSeries:
    """Return a companion's flow, as the autopilot takes it."""
    time_us, numbers, quality, sent = _columns(rows)
    units = np.array([(one.flow_x, one.flow_y) for *_, one in rows], dtype=np.float64)
    takes = takes_rates(sent) if reads_rates else np.zeros(len(rows), np.bool_)
    rate, unknown = rates_by_driver(units, sent, takes, time_us, params), np.full(units.shape, np.nan)
    return FlowSeries(_origin(whose), time_us, rate, unknown, quality, numbers, units, sent, takes)


def _origin(whose: tuple[int, int]) -> str:
    return f"OPTICAL_FLOW from {whose[0]}/{whose[1]}"


def _columns(rows: _Rows) -> tuple[Ints, Ints, Ints, Floats]:
    """Return times, numbers and qualities, N each, and flow_rate_x and flow_rate_y, N x 2."""
    table = np.array([(time_us, number, one.quality) for time_us, number, one in rows], dtype=np.int64)
    return *table.T, np.array([(one.flow_rate_x, one.flow_rate_y) for *_, one in rows], dtype=np.float64)


def _sent_range(
    whose: tuple[int, int, int, int],
    rows: list[tuple[int, int, DISTANCE_SENSOR]],
    params: Mapping[str, float],
    *,
    is_own: bool,
) -> RangeSeries:
    messages: list[Any] = [row[2] for row in rows]
    table = (
        np.array(
            [(message.current_distance, message.min_distance, message.max_distance) for message in messages], np.float64
        )
        * 0.01
    )
    dist_m, low_m, high_m = table.T
    if not is_own:
        low_m, high_m = _limits(low_m, high_m, whose[3], params)
    status = np.full(len(rows), int(RangeStatus.GOOD), dtype=np.int64)
    status[dist_m < low_m] = RangeStatus.TOO_NEAR
    status[dist_m > high_m] = RangeStatus.TOO_FAR
    return RangeSeries(
        f"DISTANCE_SENSOR {whose[2]} from {whose[0]}/{whose[1]}",
        whose[2],
        np.array([row[0] for row in rows], dtype=np.int64),
        dist_m,
        low_m,
        high_m,
        status,
        np.full(len(rows), whose[3], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.int64),
        is_sent=not is_own,
    )


def _limits(low_m: Floats, high_m: Floats, orient: int, params: Mapping[str, float]) -> tuple[Floats, Floats]:
    """Return the limits that AP_RangeFinder_MAVLink computes from those of messages and of the finder's parameters."""
    taking = (finder.number for finder in finders_in(params) if finder.is_mavlink and finder.orient == orient)
    prefix = f"RNGFND{next(taking, '')}_"
    least, most = (
        0.01 * params[f"{prefix}{name}_CM"] if f"{prefix}{name}_CM" in params else params.get(prefix + name, unlimited)
        for name, unlimited in (("MIN", 0.0), ("MAX", np.inf))
    )
    neither = (low_m == 0) & (high_m == 0)
    low, high = np.maximum(low_m, least), np.minimum(high_m, most)
    return np.where(neither, least, low), np.where(neither, most, high)
