# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The recorder without I/O: time and bytes in, bytes and a recording out.

Time is the recorder's own, in us, at the rate of the autopilot's clock. Whoever drives it hands in what comes, calls
``advance`` when something is due, and sends what that returns.
"""

import math
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from typing import Final, TypeVar

from ap_core.fmath import f32
from mav_handlers.wire.codec import Codec, Received, message_id
from mav_handlers.wire.messages import (
    AUTOPILOT_VERSION,
    COMMAND_ACK,
    COMMAND_LONG,
    EKF_STATUS_REPORT,
    HEARTBEAT,
    LOCAL_POSITION_NED,
    LOG_DATA,
    LOG_ENTRY,
    LOG_REQUEST_DATA,
    LOG_REQUEST_END,
    LOG_REQUEST_LIST,
    PARAM_ERROR,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_SET,
    PARAM_VALUE,
    SIM_STATE,
    STATUSTEXT,
    TIMESYNC,
    Message,
)
from viso.companion.sender import MavlinkSender
from viso.recording.autopilot import RATE_SPAN_US, AutopilotClock, LogPieces
from viso.recording.scenario import Ask, Change, Dropout, Jump, Pause, Scenario, Send, Set, Start, Step, Until
from viso.recording.vision import Pose, VisionStream
from viso.streams.heard import is_autopilot
from viso.streams.player import TextPieces

T = TypeVar("T")
Task = Generator[int, None, T]
"""What is done over time: yields until when it waits at the latest; a message that comes wakes it up."""

NO_ANSWER_US: Final = 10_000_000
"""How long a vehicle may be unheard: nothing goes on then."""
REBOOT_US: Final = 180_000_000
"""How long it may be away; to start a simulator takes as long, however fast its time runs."""
_RETRY_US: Final = 1_000_000
_TRIES: Final = 4
_TIMESYNC_PERIOD_US: Final = 250_000
_MOST_ASKED: Final = 16
_SETTLE_US: Final = 1_000_000
"""After the last step, in which its streams go on, so that what it brought is answered."""
_LAST_US: Final = 200_000
"""After the last message, so that it is logged."""
_LAND_US: Final = 90_000_000
_TRUTH_HZ: Final = 50
_EKF_HZ: Final = 10
_ARMED: Final = 0x80
_GROUND_STATION: Final = 255, 190
_UNASKED: Final = frozenset({"HEARTBEAT", "TIMESYNC"})
_MODE_LAND: Final = 9
_M_PER_DEG: Final = 111_318.845

_CMD_SET_MODE: Final = 176
_CMD_REBOOT: Final = 246
_CMD_SET_MESSAGE_INTERVAL: Final = 511
_CMD_REQUEST_MESSAGE: Final = 512


class RecordingError(Exception):
    """A recording cannot go on; the text is one line."""


class Stopped(RecordingError):
    """Whoever drives the recorder wants it to end."""


@dataclass(frozen=True, slots=True)
class Sent:
    """A message of a scenario: when it was sent, by the recorder's clock and the autopilot's, and its frame."""

    now_us: int
    autopilot_us: int | None
    message: Message
    frame: bytes


@dataclass(frozen=True, slots=True)
class Exchange:
    """A question, and the messages that answered it, in order."""

    ask: Ask
    answers: tuple[Message, ...]


@dataclass
class Recording:
    """What a recorder has so far.

    Attributes:
        vehicle_type: MAV_TYPE of the autopilot's heartbeat.
        params: its parameters before anything was set, in their order.
        set_params: those that the scenario set before the steps, as the autopilot took them.
        began_us: when the steps began, by the autopilot's clock.
        sent: the messages of the steps.
        texts: since the reboot, or since the begin where there is none, until the last step: severity and text.
        acks: of commands of the steps: command and result.
        events: what happened when, by the autopilot's clock where that was known.
        traffic: all frames both ways by the recorder's clock.
        log: the DataFlash log, as far as it came.
        problems: why it is not complete, a line each.
    """

    scenario: Scenario
    vehicle_type: int = 0
    version: AUTOPILOT_VERSION | None = None
    params: dict[str, float] = field(default_factory=dict)
    set_params: dict[str, float] = field(default_factory=dict)
    began_us: int | None = None
    sent: list[Sent] = field(default_factory=list)
    texts: list[tuple[int, str]] = field(default_factory=list)
    acks: list[tuple[int, int]] = field(default_factory=list)
    exchanges: list[Exchange] = field(default_factory=list)
    events: list[tuple[int | None, str]] = field(default_factory=list)
    traffic: list[tuple[int, bytes]] = field(default_factory=list)
    log: bytes = b""
    problems: list[str] = field(default_factory=list)


class Recorder:
    """Plays a scenario to an autopilot, and keeps what comes of it; ``on_progress`` gets a text at each step."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        allow_armed: bool = False,
        on_progress: Callable[[str], None] = lambda _text: None,
    ) -> None:
        self.recording = Recording(scenario)
        self.clock = AutopilotClock()
        self.is_over = False
        self._scenario = scenario
        self._allow_armed = allow_armed
        self._on_progress = on_progress
        self._now_us = 0
        self._out: list[bytes] = []
        self._incoming = Codec(*_GROUND_STATION)
        self._companion = MavlinkSender()
        self._station = Codec(*_GROUND_STATION)
        self._texts = TextPieces()
        self._target: tuple[int, int] | None = None
        self._heard_us = 0
        self._may_be_silent = True
        self._is_rebooting = False
        self._next_timesync_us = 0
        self._asked_ns: deque[int] = deque(maxlen=_MOST_ASKED)
        self._streams: list[VisionStream] = []
        self._latest: dict[str, Message] = {}
        self._woken_by: Message | None = None
        self._recent_texts: list[str] = []
        self._known: dict[str, float] = {}
        self._set: dict[str, float] = {}
        self._in_steps = False
        self._home: tuple[float, float, float] | None = None
        self._intervals: list[str] = []
        self._task = self._run()
        self._wake_us = next(self._task)

    # For whoever drives it

    @property
    def next_due_us(self) -> int:
        """When ``advance`` has something to do next."""
        streams = (stream.next_due_us() for stream in self._streams)
        return min(self._wake_us, self._companion.heartbeat_us, self._next_timesync_us, *streams)

    def advance(self, now_us: int) -> bytes:
        """Do what is due by now, and return the bytes to be sent."""
        while not self.is_over and (due_us := self.next_due_us) <= now_us:
            self._now_us = max(self._now_us, due_us)
            self._send_streams()
            for heartbeat in self._companion.heartbeats(self._now_us):
                self._put(self._companion, heartbeat)
            if self._now_us >= self._next_timesync_us:
                self._next_timesync_us = self._now_us + _TIMESYNC_PERIOD_US
                self._asked_ns.append(self._now_us * 1000)
                self._put(self._station, TIMESYNC(0, self._asked_ns[-1]))
            if self._now_us - self._heard_us > NO_ANSWER_US and not self._may_be_silent:
                self._may_be_silent = True  # as was requested
                self._interrupt(RecordingError(f"nothing heard for {NO_ANSWER_US / 1e6:g} s: the link is dead"))
            elif self._now_us >= self._wake_us:
                self._resume()
        self._now_us = max(self._now_us, now_us)
        data = b"".join(self._out)
        self._out.clear()
        return data

    def receive(self, now_us: int, data: bytes) -> None:
        """Take in bytes from the autopilot; ``advance`` comes before, up to the same time."""
        self._now_us = max(self._now_us, now_us)
        self._incoming.feed(data)
        while (received := self._incoming.next_received()) is not None:
            if isinstance(received, Received):
                self.recording.traffic.append((self._now_us, received.header.frame))
                self._take(received)

    def stop(self, why: str) -> None:
        """End what is being done: the steps, or the download of the log; what was set is restored in any case."""
        self._interrupt(Stopped(why))

    # What comes in

    def _take(self, received: Received) -> None:
        header, message = received.header, received.message
        source = header.system_id, header.component_id
        if self._target is None:
            if not is_autopilot(header.component_id, message):
                return
            self._target = source
            self._companion.system_id = source[0]
        if source != self._target or message is None:
            return
        self._heard_us = self._now_us
        self._may_be_silent = self._is_rebooting
        self._latest[type(message).__name__] = message
        if isinstance(message, TIMESYNC) and message.tc1 and message.ts1 in self._asked_ns:
            boots = self.clock.boots
            self.clock.take(message.ts1 // 1000, self._now_us, message.tc1 // 1000)
            if self.clock.boots != boots:
                self._event("the autopilot's clock started again")
        elif isinstance(message, STATUSTEXT):
            for severity, text in self._texts.take(message):
                if self._in_steps or self.recording.began_us is None:
                    self.recording.texts.append((severity, text))
                self._recent_texts.append(text)
                self._event(f"text {severity}: {text}")
        elif isinstance(message, COMMAND_ACK) and self._in_steps:
            self.recording.acks.append((message.command, message.result))
        elif isinstance(message, SIM_STATE):
            self._take_truth(message)
        self._woken_by = message
        self._resume()
        self._woken_by = None

    def _take_truth(self, message: SIM_STATE) -> None:
        # The degrees are float32, a metre wide; later senders add whole numbers.
        place = (message.lat_int, message.lon_int) if message.lat_int else (message.lat * 1e7, message.lon * 1e7)
        latitude, longitude = place[0] * 1e-7, place[1] * 1e-7
        if self._home is None:
            self._home = latitude, longitude, message.alt
        velocity = message.vn, message.ve, message.vd
        north = (latitude - self._home[0]) * _M_PER_DEG
        east = (longitude - self._home[1]) * _M_PER_DEG * math.cos(math.radians(self._home[0]))
        pose = Pose((north, east, self._home[2] - message.alt), velocity, (message.roll, message.pitch, message.yaw))
        for stream in self._streams:
            stream.take_truth(pose)

    # What goes out

    def _put(self, codec: Codec, message: Message) -> bytes:
        frame = codec.encode(message)
        self.recording.traffic.append((self._now_us, frame))
        self._out.append(frame)
        return frame

    def _put_step(self, codec: Codec, message: Message) -> None:
        if getattr(message, "target_system", 0) == 1 and self._to[0] != 1:
            message = replace(message, target_system=self._to[0])
        if isinstance(message, PARAM_SET) and message.param_id in self._known:
            self._set.setdefault(message.param_id, self._known[message.param_id])
        frame = self._put(codec, message)
        self.recording.sent.append(Sent(self._now_us, self.clock.time_us(self._now_us), message, frame))

    def _send_streams(self) -> None:
        for stream in self._streams:
            for message in stream.due_messages(self._now_us):
                self._put_step(self._companion, message)

    def _command(self, command: int, *params: float) -> COMMAND_LONG:
        return COMMAND_LONG(*self._to, command, 0, *params, *(0.0,) * (7 - len(params)))

    def _event(self, text: str) -> None:
        self.recording.events.append((self.clock.time_us(self._now_us), text))

    # Tasks

    def _resume(self) -> None:
        try:
            self._wake_us = next(self._task)
        except StopIteration:
            self.is_over = True

    def _interrupt(self, error: RecordingError) -> None:
        if self.is_over:
            return
        try:
            self._wake_us = self._task.throw(error)
        except StopIteration:
            self.is_over = True

    def _sleep(self, duration_us: int) -> Task[None]:
        end_us = self._now_us + duration_us
        while self._now_us < end_us:
            yield end_us

    def _wait(
        self, kind: type[T], timeout_us: int, fits: Callable[[T], bool] = lambda _message: True
    ) -> Task[T | None]:
        """Return the next message of a kind that fits; None if none comes in time."""
        end_us = self._now_us + timeout_us
        while self._now_us < end_us:
            yield end_us
            message = self._woken_by
            if message is not None and isinstance(message, kind) and fits(message):
                return message
        return None

    def _run(self) -> Task[None]:
        yield from self._attempt(self._prepare())
        if not self.recording.problems:
            yield from self._attempt(self._play())
        if self.recording.began_us is not None:
            yield from self._attempt(self._land())
            yield from self._attempt(self._download())
        yield from self._attempt(self._restore())

    def _attempt(self, task: Task[None]) -> Task[None]:
        try:
            yield from task
        except RecordingError as error:
            self.recording.problems.append(str(error))
            self._event(f"incomplete: {error}")
        self._streams.clear()
        self._in_steps = False

    # Before the steps

    def _prepare(self) -> Task[None]:
        self._on_progress("waiting for the autopilot")
        end_us = self._now_us + NO_ANSWER_US
        while self._target is None:
            if self._now_us >= end_us:
                raise RecordingError(f"no answer within {NO_ANSWER_US / 1e6:g} s: no autopilot is heard")
            yield end_us
        beat = self._latest["HEARTBEAT"]
        assert isinstance(beat, HEARTBEAT)
        self.recording.vehicle_type = beat.type
        if self._is_armed and not self._allow_armed:
            raise RecordingError("the vehicle is armed (--allow-armed records it all the same)")
        yield from self._read_version()
        yield from self._sleep(RATE_SPAN_US + 2 * _TIMESYNC_PERIOD_US)  # for whoever follows the autopilot's clock
        yield from self._read_parameters()
        for name, value in self._scenario.parameters.items():
            self.recording.set_params[name] = yield from self._set_parameter(name, value)
        for name, value in self._scenario.if_there.items():
            if name in self.recording.params:
                self.recording.set_params[name] = yield from self._set_parameter(name, value)
        if self._scenario.reboot:
            self.recording.texts.clear()
            yield from self._reboot()
            yield from self._check_still_set()
        yield from self._ask_for_telemetry()
        for wanted in self._scenario.wait:
            yield from self._until(wanted)

    def _read_version(self) -> Task[None]:
        for _ in range(_TRIES):
            self._put(self._station, self._command(_CMD_REQUEST_MESSAGE, message_id("AUTOPILOT_VERSION")))
            self.recording.version = yield from self._wait(AUTOPILOT_VERSION, _RETRY_US)
            if self.recording.version is not None:
                return
        raise RecordingError("no answer: the autopilot does not tell its version")

    def _read_parameters(self) -> Task[None]:
        self._on_progress("reading parameters")
        found: dict[int, PARAM_VALUE] = {}
        count = 0
        tries = 0
        self._put(self._station, PARAM_REQUEST_LIST(*self._to))
        while tries < 3 * _TRIES:
            value = yield from self._wait(PARAM_VALUE, _RETRY_US)
            if value is not None and value.param_index < value.param_count:
                found[value.param_index], count = value, value.param_count
                tries = 0
            if count and len(found) >= count:
                break
            if value is None:
                tries += 1
                missing = [index for index in range(count) if index not in found]
                if not missing:
                    self._put(self._station, PARAM_REQUEST_LIST(*self._to))
                for index in missing[:20]:
                    self._put(self._station, PARAM_REQUEST_READ(*self._to, "", index))
        if not count or len(found) < count:
            raise RecordingError(f"no answer: {len(found)} of {count or 'all'} parameters came")
        for _, message in sorted(found.items()):
            self.recording.params[message.param_id] = message.param_value
        self._known.update(self.recording.params)

    @property
    def _to(self) -> tuple[int, int]:
        return self._target or (1, 1)

    def _set_parameter(self, name: str, value: float, *, codec: Codec | None = None) -> Task[float]:
        """Set a parameter and return the value that the autopilot then has. Raises RecordingError if it refuses."""
        before = yield from self._read_parameter(name)
        if before is None:
            raise RecordingError(f"parameter {name}: the autopilot has none of that name")
        self._known.setdefault(name, before.param_value)
        wanted = float(f32(value))
        if before.param_value == wanted and codec is None:
            return wanted
        self._set.setdefault(name, before.param_value)
        reported: float = before.param_value
        for _ in range(_TRIES):
            message = PARAM_SET(*self._to, name, value, before.param_type)
            if codec is None:
                self._put(self._station, message)
            else:
                self._put_step(codec, message)
            answer = yield from self._answer_about(name)
            if isinstance(answer, PARAM_VALUE):
                reported = answer.param_value
                if reported == wanted:
                    return reported
                break
            if isinstance(answer, PARAM_ERROR):
                raise RecordingError(f"parameter {name}: {value:g} is refused (PARAM_ERROR {answer.error})")
        raise RecordingError(f"parameter {name}: {value:g} is refused, it stays {reported:g}")

    def _read_parameter(self, name: str) -> Task[PARAM_VALUE | None]:
        for _ in range(_TRIES):
            self._put(self._station, PARAM_REQUEST_READ(*self._to, name, -1))
            found = yield from self._answer_about(name, "")
            if isinstance(found, PARAM_VALUE):
                return found
            if isinstance(found, PARAM_ERROR) or name not in self.recording.params:
                return None
        return None

    def _answer_about(self, *names: str) -> Task[object]:
        kinds = PARAM_VALUE | PARAM_ERROR
        return self._wait(object, _RETRY_US, lambda one: isinstance(one, kinds) and one.param_id in names)

    def _reboot(self) -> Task[None]:
        self._on_progress("rebooting")
        self._may_be_silent = self._is_rebooting = True
        boots, end_us = self.clock.boots, self._now_us + REBOOT_US
        for _ in range(_TRIES):
            self._put(self._station, self._command(_CMD_REBOOT, 1))
            ack = yield from self._wait(COMMAND_ACK, _RETRY_US, lambda one: one.command == _CMD_REBOOT)
            if ack is not None and ack.result:
                raise RecordingError(f"the autopilot does not reboot (result {ack.result})")
            if ack is not None or self.clock.boots != boots:
                break
        while self.clock.boots == boots:
            if self._now_us >= end_us:
                raise RecordingError(f"the autopilot did not come back from a reboot within {REBOOT_US / 1e6:g} s")
            yield end_us
        self._may_be_silent = self._is_rebooting = False
        self._latest.clear()
        self._recent_texts.clear()

    def _check_still_set(self) -> Task[None]:
        """Raise RecordingError if the reboot has undone what was set, as that of a simulator with --wipe does."""
        for name, value in self.recording.set_params.items():
            kept = yield from self._read_parameter(name)
            if kept is None:
                raise RecordingError(f"parameter {name}: the autopilot does not tell it after the reboot")
            if kept.param_value != value:
                raise RecordingError(f"parameter {name}: set to {value:g}, after the reboot it is {kept.param_value:g}")

    def _ask_for_telemetry(self) -> Task[None]:
        scenario = self._scenario
        if scenario.needs_ekf:
            self._ask_for("EKF_STATUS_REPORT", _EKF_HZ)
        if scenario.needs_position:
            self._ask_for("LOCAL_POSITION_NED", _EKF_HZ)
        if scenario.needs_flight:
            self._ask_for("SIM_STATE", _TRUTH_HZ)
            if (yield from self._wait(SIM_STATE, NO_ANSWER_US)) is None:
                raise RecordingError("this scenario flies, and needs a simulator: the autopilot sends no SIM_STATE")

    def _ask_for(self, name: str, rate_hz: float) -> None:
        self._intervals.append(name)
        self._put(self._station, self._command(_CMD_SET_MESSAGE_INTERVAL, message_id(name), 1e6 / rate_hz))

    # The steps

    def _play(self) -> Task[None]:
        self.recording.began_us = self.clock.time_us(self._now_us)
        self._in_steps = True
        count = len(self._scenario.steps)
        for number, step in enumerate(self._scenario.steps, 1):
            what = type(step).__name__.lower()
            self._event(f"step {number}: {what}")
            self._on_progress(f"step {number} of {count}: {what}")
            try:
                yield from self._do(step)
            except Stopped:
                raise
            except RecordingError as error:
                raise RecordingError(f"step {number}: {error}") from None
        yield from self._sleep(_SETTLE_US)
        self._streams.clear()
        yield from self._sleep(_LAST_US)

    def _do(self, step: Step) -> Task[None]:
        match step:
            case Pause(duration_s):
                yield from self._sleep(round(duration_s * 1e6))
            case Start(streams):
                self._streams = [VisionStream(one, self._now_us) for one in streams]
                self._send_streams()
            case Change(values):
                for stream in self._streams:
                    stream.change(values)
            case Jump():
                for stream in self._streams:
                    stream.jump(step)
            case Dropout(duration_s):
                duration_us = round(duration_s * 1e6)
                for stream in self._streams:
                    stream.be_silent(self._now_us + duration_us)
                yield from self._sleep(duration_us)
            case Set(parameters):
                for name, value in parameters.items():
                    yield from self._set_parameter(name, value, codec=self._companion)
            case Send(message):
                self._put_step(self._companion, message)
            case Ask():
                yield from self._ask(step)
            case Until():
                yield from self._until(step)

    def _ask(self, ask: Ask) -> Task[None]:
        hidden = (_UNASKED - set(ask.show)) | set(ask.hide)
        self._put_step(self._station, ask.message)
        answers: list[Message] = []
        end_us = self._now_us + round(ask.wait_s * 1e6)
        while self._now_us < end_us:
            yield end_us
            message = self._woken_by
            is_ours = isinstance(message, TIMESYNC) and message.ts1 in self._asked_ns
            if message is not None and not is_ours and type(message).__name__ not in hidden:
                answers.append(message)
        self.recording.exchanges.append(Exchange(ask, tuple(answers)))

    def _until(self, wanted: Until) -> Task[None]:
        end_us = self._now_us + round(wanted.timeout_s * 1e6)
        while not self._is_so(wanted):
            wake_us = end_us
            if wanted.clock_s is not None and self.clock.boot_us is not None:
                due_us = self.clock.boot_us + round(wanted.clock_s * 1e6)
                if due_us > self._now_us:
                    wake_us = min(end_us, due_us)
            if self._now_us >= end_us:
                raise RecordingError(f"waited {wanted.timeout_s:g} s in vain for {wanted}")
            yield wake_us
        if wanted.text is not None:
            self._recent_texts.clear()

    def _is_so(self, wanted: Until) -> bool:
        if wanted.text is not None and not any(wanted.text in text for text in self._recent_texts):
            return False
        report, beat = self._latest.get("EKF_STATUS_REPORT"), self._latest.get("HEARTBEAT")
        if wanted.ekf is not None and not (isinstance(report, EKF_STATUS_REPORT) and not wanted.ekf & ~report.flags):
            return False
        shown_us = self.clock.time_us(self._now_us)
        if wanted.clock_s is not None and (shown_us is None or shown_us < round(wanted.clock_s * 1e6)):
            return False
        if wanted.armed is not None and not (isinstance(beat, HEARTBEAT) and self._is_armed == wanted.armed):
            return False
        if wanted.near_m is None:
            return True
        place = self._latest.get("LOCAL_POSITION_NED")
        return isinstance(place, LOCAL_POSITION_NED) and (
            math.dist((place.x, place.y, place.z), wanted.near_m) <= wanted.within_m
        )

    @property
    def _is_armed(self) -> bool:
        beat = self._latest.get("HEARTBEAT")
        return isinstance(beat, HEARTBEAT) and bool(beat.base_mode & _ARMED)

    # After the steps

    def _land(self) -> Task[None]:
        """Bring a vehicle down that a scenario has left in the air."""
        if not self._is_armed or not self._scenario.needs_flight:
            return
        self._on_progress("landing")
        self._put(self._station, self._command(_CMD_SET_MODE, 1, _MODE_LAND))
        if (yield from self._wait(HEARTBEAT, _LAND_US, lambda one: not one.base_mode & _ARMED)) is None:
            raise RecordingError("the vehicle is still armed after the scenario")

    def _download(self) -> Task[None]:
        self._on_progress("downloading the log")
        try:
            yield from self._fetch_log()
        except RecordingError as error:
            raise RecordingError(f"the log cannot be downloaded: {error}") from None

    def _fetch_log(self) -> Task[None]:
        self._check_link()
        entry = None
        for _ in range(_TRIES):
            self._put(self._station, LOG_REQUEST_LIST(*self._to, 0, 0xFFFF))
            entry = yield from self._wait(LOG_ENTRY, 3 * _RETRY_US, lambda one: one.id == one.last_log_num)
            if entry is not None:
                break
        if entry is None or not entry.num_logs:
            raise RecordingError("no answer" if entry is None else "there is none")
        pieces, tries = LogPieces(entry.id), 0
        try:
            while not pieces.is_whole and tries < _TRIES:
                self._put(self._station, LOG_REQUEST_DATA(*self._to, entry.id, *pieces.gap()))
                tries += 1
                while not pieces.is_whole and (piece := (yield from self._wait(LOG_DATA, _RETRY_US))) is not None:
                    tries = 0 if pieces.take(piece) else tries
        finally:
            self.recording.log = pieces.data()
            self._put(self._station, LOG_REQUEST_END(*self._to))
        if not pieces.is_whole:
            raise RecordingError(f"{len(self.recording.log)} bytes came, then none")

    def _check_link(self) -> None:
        if self._target is None or self._now_us - self._heard_us > NO_ANSWER_US:
            raise RecordingError("the link is dead")

    def _restore(self) -> Task[None]:
        if not self._set and not self._intervals:
            return
        self._on_progress("restoring parameters")
        self._is_rebooting = False
        left = dict(self._set)
        why: RecordingError | None = None
        try:
            for name, value in reversed(self._set.items()):
                self._check_link()
                try:
                    yield from self._set_parameter(name, value)
                    del left[name]
                except Stopped:
                    raise
                except RecordingError as error:
                    why = error
            for name in self._intervals:
                self._put(self._station, self._command(_CMD_SET_MESSAGE_INTERVAL, message_id(name), 0))
            if self._scenario.reboot:
                yield from self._reboot()
        except RecordingError as error:
            why = error
        if left:
            values = ", ".join(f"{name}={value:g}" for name, value in left.items())
            raise RecordingError(f"parameters are not restored: {values}: {why}")
        if why is not None:
            raise why
