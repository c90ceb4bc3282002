# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The emulated autopilot in virtual time, within the process of a test."""

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Final, TypeVar

from ap_core.verdict import VerdictKind
from mav_handlers.wire.messages import (
    COMMAND_ACK,
    COMMAND_LONG,
    SET_GPS_GLOBAL_ORIGIN,
    SET_POSITION_TARGET_LOCAL_NED,
    Message,
)
from viso.files.outputs import replace_file
from viso.firmware.releases import PROFILES
from viso.testing import claims
from viso.testing.golden import GoldenFiles
from viso.testing.observations import MessageVerdict, Record, StatusText
from viso.testing.observer import VISION_RECORDS, Observer
from viso.testing.options import AutopilotOptions
from viso.testing.sender import Sender
from viso.testing.vehicle import LiveParams, booted_vehicle
from viso.vehicle.outcomes import FilterWatch
from viso.vehicle.sensors.airframe import Airframe
from viso.vehicle.sensors.motion import Truth
from viso.vehicle.vehicle import LOOP_PERIOD_US

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is

M = TypeVar("M", bound=Message)

GUIDED: Final = 4
NEAR_M: Final = 0.2

_STEP_S: Final = 0.05
_ARM, _TAKEOFF, _LAND, _SET_MODE = 400, 22, 21, 176
_ONLY_POSITION: Final = 0b0000_1101_1111_1000  # of SET_POSITION_TARGET_LOCAL_NED.type_mask
_WITH_YAW: Final = ~(1 << 10)


@dataclass(slots=True)
class _Call:
    """A function that is called again and again, and when next."""

    period_us: int
    call: Callable[[], None]
    at_us: int


class Autopilot:
    """A vehicle with one MAVLink link, whose time goes on in ``advance`` only.

    It has run for 6.5 s when it is made; its texts until then are in its log only. What is sent to it is handled at
    once. All lists begin then, or with ``clear``.

    Args:
        options: what vehicle it is.
        golden: where golden logs are; None if there are none.

    Attributes:
        vehicle: the vehicle itself, for what is not here.
        params: its parameters by name, to be read and set.

    Raises:
        ValueError: an option cannot be used.
    """

    _stride_us = 50_000
    """After so much time, what it has sent is taken over, and what was sent to it by other ways taken in."""

    def __init__(self, options: AutopilotOptions | None = None, golden: GoldenFiles | None = None) -> None:
        self._options = options or AutopilotOptions()
        booted = booted_vehicle(self._options)
        self.vehicle = booted.vehicle
        self.params = LiveParams(self.vehicle)
        self._scheduler = booted.scheduler
        self._channel = booted.channel
        self._logs = booted.logs
        self._golden = golden
        self._watch = FilterWatch(self.vehicle)
        self._observer = Observer(self.vehicle, self._watch)
        self._sender = Sender()
        self._unread = bytearray()
        self._calls: list[_Call] = []

    def close(self) -> None:
        """Close the vehicle; the fixture does that."""
        self.vehicle.close()

    # Time

    @property
    def now_us(self) -> int:
        """The vehicle's time in us since boot."""
        return self._scheduler.now_us

    def advance(self, *, ms: float | None = None, s: float | None = None) -> None:
        """Run the vehicle for a duration of its own time, in ms or in s; that takes a fraction of it.

        Raises ValueError: not one of the two is given, or it is no duration.
        """
        if (ms is None) is (s is None):
            raise ValueError("advance takes either ms= or s=")
        duration_us = ms * 1e3 if ms is not None else (s or 0.0) * 1e6
        if not 0 <= duration_us < math.inf:
            raise ValueError(f"advance by {duration_us * 1e-6} s: not a duration")
        self._begin()
        self._run_until(self.now_us + round(duration_us))

    def _run_until(self, time_us: int) -> None:
        while (pass_us := self._next_pass_us()) <= time_us:
            self._take_input()
            until_us = min(time_us, self.now_us + self._stride_us, *(due.at_us for due in self._calls))
            self._pass(max(pass_us, until_us))
            for due in self._calls:
                if due.at_us <= self.now_us:
                    due.at_us += due.period_us
                    due.call()
        self._scheduler.run_until(time_us)

    def _next_pass_us(self) -> int:
        return self.now_us // LOOP_PERIOD_US * LOOP_PERIOD_US + LOOP_PERIOD_US

    def _pass(self, time_us: int) -> None:
        self._scheduler.run_until(time_us)
        self._take_output()
        self._observer.forget_old_samples()

    # The link

    def send(self, message: object, *, system_id: int = 1, component_id: int = 197) -> tuple[MessageVerdict, ...]:
        """Hand a message to the autopilot now, and return its outcome.

        A message gives one verdict. Bytes give any number: none while a frame is not whole.

        Args:
            message: one of ``mav_handlers.wire.messages``, one of pymavlink's, or bytes as they come from a link.
            system_id: whose frame a message is put into; bytes are left as they are.
            component_id: likewise.

        Raises:
            TypeError: it is none of these.
            ValueError: an id is out of range, a field does not fit its type, or nobody here knows the message.
        """
        self._begin()
        frame = self._sender.frame(message, system_id, component_id)
        before = len(self._observer.verdicts)
        self._deliver(frame)
        return tuple(self._observer.verdicts[before:])

    def write(self, data: bytes) -> None:
        """Hand bytes to the autopilot now, as to the ``write`` of a serial port."""
        self.send(data)

    def read(self) -> bytes:
        """Return the bytes that the autopilot has sent since the last call, as from the ``read`` of a serial port."""
        self._begin()
        data = bytes(self._unread)
        self._unread.clear()
        return data

    def _deliver(self, data: bytes) -> None:
        self._scheduler.deliver(self._channel, data)
        self._take_output()

    def _take_output(self) -> None:
        data = self.vehicle.endpoint.bytes_to_send(self._channel)
        if data:
            self._observer.take_output(data)
            self._unread += data
            self._put_output(data)

    def _begin(self) -> None:
        """Make ready for a call that changes something."""
        self._sync()

    def _sync(self) -> None:
        """Take in what was sent by other ways before now."""

    def _take_input(self) -> None:
        """Take in what has come by other ways, before a pass of the main loop."""

    def _put_output(self, data: bytes) -> None:
        """Send bytes by other ways."""

    # Flight

    def every(self, ms: float, call: Callable[[], None]) -> None:
        """Call a function again and again while time goes on, such as a camera that sends poses.

        Raises ValueError: the period is less than a pass of the main loop, 2.5 ms.
        """
        period_us = round(1e3 * ms)
        if period_us < LOOP_PERIOD_US:
            raise ValueError(f"every {ms} ms: less than a pass of the main loop, 2.5 ms")
        self._calls.append(_Call(period_us, call, self.now_us + period_us))

    @property
    def truth(self) -> Truth:
        """Where the vehicle really is: ``pos_ned`` in m, ``vel_ned`` in m/s, ``quat_wxyz``; with imu="fly" alone."""
        return self._airframe().truth()

    def takeoff(self, height_m: float, *, within_s: float = 30.0) -> None:
        """Change to GUIDED, arm, take off, and wait until the vehicle is there by its own estimate.

        A vehicle without an origin gets its home as such.

        Raises:
            AssertionError: it refused, or was not there in time; the text has what it said.
            ValueError: it is no vehicle that flies.
        """
        self._airframe()
        start_m, copter = self._height_m(), self.vehicle.copter
        if self.vehicle.ahrs.origin() is None:
            home = self.vehicle.source.home
            self._send_as_station(SET_GPS_GLOBAL_ORIGIN(1, home.lat, home.lng, 10 * home.alt_cm))
        self._command(_SET_MODE, 1.0, GUIDED)
        self._wait(lambda: copter.arming.pre_arm_checks(display=False), within_s, "readiness to arm")
        self._command(_ARM, 1.0)
        self._command(_TAKEOFF, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, height_m)
        self._wait(lambda: self._height_m() > start_m + height_m - NEAR_M, within_s, f"a height of {height_m} m")

    def goto(
        self, north_m: float, east_m: float, height_m: float, *, yaw_deg: float | None = None, within_s: float = 60.0
    ) -> None:
        """Fly to a place, counted from the EKF's origin, and wait until the vehicle is there by its own estimate.

        Raises:
            AssertionError: it was not there in time; the text has its position and what it said.
            ValueError: it is no vehicle that flies.
        """
        self._airframe()
        mask = _ONLY_POSITION if yaw_deg is None else _ONLY_POSITION & _WITH_YAW
        zeros = (0.0,) * 6
        target = north_m, east_m, -height_m
        yaw_rad = math.radians(yaw_deg or 0.0)
        self._send_as_station(SET_POSITION_TARGET_LOCAL_NED(0, 1, 1, 1, mask, *target, *zeros, yaw_rad, 0.0))

        def is_there() -> bool:
            pos = self.vehicle.ahrs.get_relative_position_NED_origin_float()
            return pos is not None and math.dist(pos.to_tuple(), target) < NEAR_M

        self._wait(is_there, within_s, f"{north_m} m north, {east_m} m east at {height_m} m")

    def land(self, *, within_s: float = 60.0) -> None:
        """Land, and wait until the vehicle has disarmed itself.

        Raises:
            AssertionError: it refused, or did not in time; the text has what it said.
            ValueError: it is no vehicle that flies.
        """
        self._airframe()
        self._command(_LAND)
        self._wait(lambda: not self.vehicle.copter.is_armed(), within_s, "the ground")

    def _airframe(self) -> Airframe:
        """Return what flies. Raises ValueError if the vehicle does not fly."""
        airframe = self.vehicle.source.airframe
        if airframe is None:
            raise ValueError("this autopilot does not fly: ask for imu='fly'")
        return airframe

    def _height_m(self) -> float:
        pos = self.vehicle.ahrs.get_relative_position_NED_origin_float()
        return 0.0 if pos is None else -float(pos.z)

    def _send_as_station(self, message: Message) -> None:
        """Send a message as a ground station does."""
        self.send(message, system_id=255, component_id=190)

    def _command(self, number: int, *params: float) -> None:
        """Send a command. Raises AssertionError if it is refused."""
        self._send_as_station(COMMAND_LONG(1, 1, number, 0, *params, *(0.0,) * (7 - len(params))))
        answers = [ack.result for ack in self.received_of(COMMAND_ACK) if ack.command == number]
        if answers[-1:] != [0]:
            self.advance(ms=50)
            raise AssertionError(f"command {number} was refused (result {answers[-1:]}){self._last_texts()}")

    def _wait(self, is_done: Callable[[], bool], within_s: float, what: str) -> None:
        """Let time go on until something is so. Raises AssertionError if it is not within a time."""
        end_us = self.now_us + round(1e6 * within_s)
        while not is_done():
            if self.now_us >= end_us:
                where = ", ".join(f"{part:.2f}" for part in self.truth.pos_ned)
                mode = self.vehicle.copter.modes.current.name
                raise AssertionError(
                    f"{what} was not reached in {within_s} s: the vehicle is in {mode}, really at {where} m (NED)"
                    f"{self._last_texts()}"
                )
            self.advance(s=_STEP_S)

    def _last_texts(self) -> str:
        texts = [text.text for text in self.status_texts[-5:]]
        return f"; the autopilot said last: {'; '.join(texts)}" if texts else "; the autopilot said nothing"

    # Observations

    def clear(self) -> None:
        """Empty the lists of verdicts, texts, records and received messages."""
        self._begin()
        self._observer.clear()

    @property
    def verdicts(self) -> list[MessageVerdict]:
        """Outcome of each message, in order."""
        self._sync()
        return list(self._observer.verdicts)

    @property
    def status_texts(self) -> list[StatusText]:
        """The texts that the autopilot sent."""
        self._sync()
        return list(self._observer.status_texts)

    @property
    def records(self) -> list[Record]:
        """The records that it wrote to its log, but for parameters (PARM)."""
        self._sync()
        return list(self._observer.records)

    def records_of(self, *names: str) -> list[Record]:
        """Return the records of some types, such as VISP."""
        return [record for record in self.records if record.name in names]

    @property
    def received(self) -> list[Message]:
        """The messages that the autopilot sent."""
        self._sync()
        return list(self._observer.received)

    def received_of(self, kind: type[M]) -> list[M]:
        """Return the messages of one type that the autopilot sent."""
        return [message for message in self.received if isinstance(message, kind)]

    @property
    def aiding(self) -> str:
        """How the filter navigates: none, absolute (by position) or relative (by velocity alone)."""
        self._sync()
        return self._watch.mode().value

    @property
    def log_bytes(self) -> bytes:
        """The DataFlash log, from boot on; the newest one if there are several, and nothing if there is none."""
        self._sync()
        return bytes(self._logs[-1].data) if self._logs else b""

    def write_log(self, path: str | Path) -> None:
        """Write the DataFlash log to a file, for any program that reads .BIN.

        Raises:
            ValueError: there is none, as LOG_DISARMED is 0 and the vehicle was never armed.
            OSError: as the file system says.
        """
        data = self.log_bytes
        if not data:
            raise ValueError("there is no log: LOG_DISARMED is 0, and the vehicle was never armed")
        replace_file(Path(path), data)

    # What a test claims

    def assert_accepted(self, count: int | None = None, message: str | type[Message] | None = None) -> None:
        """Claim that messages were passed to the filter.

        Args:
            count: exactly so many. Without it: at least one, and nothing that carries navigation was dropped, withheld
                or damaged.
            message: count those of one name or type only.

        Raises:
            AssertionError: it is not so; the text tells what did become of messages.
            ValueError: no message has that name, or the count is none.
        """
        claim = claims.make_claim(VerdictKind.ACCEPTED, message, None, count)
        verdicts = self.verdicts
        claims.check_claim(claim, verdicts)
        if count is None:
            claims.check_nothing_lost(verdicts, claim.message)

    def assert_dropped(
        self, reason: str | None = None, count: int | None = None, message: str | type[Message] | None = None
    ) -> None:
        """Claim that messages had no effect at all.

        Args:
            reason: the code of the rule by which, such as odometry_frames.
            count: exactly so many; at least one without it.
            message: count those of one name or type only.

        Raises:
            AssertionError: it is not so; the text tells what did become of messages.
            ValueError: no message has that name, by no rule of that code messages are dropped, or the count is none.
        """
        claims.check_claim(claims.make_claim(VerdictKind.DROPPED, message, reason, count), self.verdicts)

    def assert_ignored(
        self, reason: str | None = None, count: int | None = None, message: str | type[Message] | None = None
    ) -> None:
        """Claim that messages were logged and counted for health, but withheld from the filter.

        Args:
            reason: the code of the rule by which, such as quality_below_min.
            count: exactly so many; at least one without it.
            message: count those of one name or type only.

        Raises:
            AssertionError: it is not so; the text tells what did become of messages.
            ValueError: no message has that name, by no rule of that code messages are ignored, or the count is none.
        """
        claims.check_claim(claims.make_claim(VerdictKind.IGNORED, message, reason, count), self.verdicts)

    def assert_fused(self, kind: str = "pose", count: int | None = None) -> None:
        """Claim that the filter, a model of EKF3, fused samples; it decides some 60 to 250 ms after a message.

        Args:
            kind: pose, height, yaw, velocity or odometry.
            count: exactly so many; at least one without it.

        Raises:
            AssertionError: it is not so; the text tells what did become of samples.
            ValueError: there is no such kind, or the count is none.
        """
        claims.check_fused(self.verdicts, kind, count)

    def assert_text(self, part: str) -> None:
        """Claim that a text of the autopilot contains a part.

        Raises AssertionError: no text does; the error has the last texts.
        """
        claims.check_text(part, self.status_texts)

    def assert_healthy(self) -> None:
        """Claim that now neither the camera nor the estimator would keep the vehicle from arming.

        Raises AssertionError: the text has the words of the pre-arm checks, and the outcome of messages.
        """
        verdicts = self.verdicts
        failures = self._pre_arm_failures()
        if failures:
            what = claims.what_became(verdicts)
            raise AssertionError(f"expected a healthy vehicle, but {', and '.join(failures)}{what}")

    def assert_no_findings(self, least: str = "warning", but: Collection[str] = ()) -> None:
        """Claim that the doctor finds nothing wrong with what was sent, since the start or since ``clear``.

        It tries the stream on another vehicle with the same parameters, as ``viso doctor`` does with a recording in
        which no vehicle is heard; that takes about as long as sending took. With ``imu="fly"`` it holds the stream
        against where the vehicle really was; without, nothing but the stream tells how it moved, and positions and
        attitudes of other axes that fit each other, such as ENU at one height, look like right ones.

        Args:
            least: error, warning or note: what is less does not count.
            but: codes that do not count, such as XN4-03.

        Raises:
            AssertionError: there are findings; the text has them, each with its evidence and what to change.
            ValueError: there is no such severity or code.
        """
        from viso.testing.diagnosis import check_no_findings, findings_in  # the doctor takes a while to import

        self._sync()
        firmware = PROFILES[self._options.firmware]
        check_no_findings(findings_in(self._observer, self.vehicle, firmware), least, but)

    def _pre_arm_failures(self) -> list[str]:
        camera = self.vehicle.visual_odom
        vision = camera.pre_arm_check() if camera.enabled() else "VISO_TYPE is 0"
        estimator = self.vehicle.ahrs.pre_arm_failure(requires_position=False)
        named = (("VisOdom", vision), ("AHRS", estimator))
        return [f"{name}: {failure}" for name, failure in named if failure is not None]

    def assert_golden(
        self, name: str, *, records: Collection[str] = VISION_RECORDS, leave_out: Collection[str] = ()
    ) -> None:
        """Claim that the log's records are those of the file ``golden/NAME.jsonl`` beside the test's module.

        With ``--update-golden`` the file is written instead.

        Args:
            name: of the file, without its ending.
            records: which types of records.
            leave_out: labels of fields that differ from run to run, as a sender's stamps by the wall clock do
                (RTimeUS, CTimeMS).

        Raises:
            AssertionError: the file is missing or tells something else; the text shows the difference.
            ValueError: the name is none, or there are no such records or fields.
        """
        if self._golden is None:
            raise ValueError(f"golden log {name!r}: this autopilot was made without a folder of golden logs")
        self._golden.check(name, self.records_of(*records), leave_out)
