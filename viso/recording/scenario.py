# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a scenario says: parameters, what to wait for, and steps; and how one is read from YAML."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import COMMAND_LONG, MESSAGES, SET_GPS_GLOBAL_ORIGIN, Message
from viso.documents import parsed_yaml
from viso.errors import InputError, file_errors
from viso.recording.fields import Fields, message_of, number, numbers

FOLDER: Final = Path(__file__).parent / "scenarios"
SCENARIOS: Final[Mapping[str, Path]] = MappingProxyType({path.stem: path for path in sorted(FOLDER.glob("*.yaml"))})
"""The scenarios that come along, by name."""

VISION: Final = (
    "VISION_POSITION_ESTIMATE",
    "VISION_SPEED_ESTIMATE",
    "VISION_POSITION_DELTA",
    "VICON_POSITION_ESTIMATE",
    "GLOBAL_VISION_POSITION_ESTIMATE",
    "ATT_POS_MOCAP",
    "ODOMETRY",
)
"""Messages that a stream may have."""

MOTIONS: Final = ("still", "line", "circle", "truth")
EKF_FLAGS: Final = {
    "attitude": 1 << 0,
    "velocity_horiz": 1 << 1,
    "velocity_vert": 1 << 2,
    "pos_horiz_rel": 1 << 3,
    "pos_horiz_abs": 1 << 4,
    "pos_vert_abs": 1 << 5,
    "pos_vert_agl": 1 << 6,
    "const_pos_mode": 1 << 7,
    "pred_pos_horiz_rel": 1 << 8,
    "pred_pos_horiz_abs": 1 << 9,
    "uninitialized": 1 << 10,
}
"""Flags of EKF_STATUS_REPORT by the names that scenarios use."""

_MAV_CMD_ARM: Final = 400
_MAV_CMD_SET_EKF_SOURCE_SET: Final = 42007
_LONGEST_S: Final = 3600.0


@dataclass(frozen=True, slots=True)
class Stream:
    """A message that a companion computer sends again and again, and what is in it.

    Attributes:
        message: its name.
        rate_hz: how often.
        motion: of the camera: still, on a line, on a circle, or the vehicle's own as a simulator tells it.
        position_m: NED, where the motion begins, or the middle of the circle.
        heading_deg: of the camera, clockwise from north.
        velocity_m_s: NED, of a line.
        radius_m, period_s: of a circle.
        wobble_deg: how far roll and pitch go back and forth, once in 4 s.
        noise_m, noise_deg: standard deviations of what is added to position and angles.
        seed: of noise and of random delays.
        quality: of ODOMETRY, -1 to 100, and the confidence of VISION_POSITION_DELTA.
        covariance: of the pose, from its first element on; the others are zero.
        velocity_covariance: of the velocity, likewise.
        frames: frame and child frame of ODOMETRY; LOCAL_FRD and BODY_FRD are 20 and 12.
        stamp_offset_s: what the sender's clock shows when the stream begins.
        stamp_unit_us: what the stamps count, in us.
        drift_ppm: how much faster than the autopilot's the sender's clock runs.
        delays_ms: from a stamp to its sending, one after the other and again.
        random_delay_ms: the most that is added to that at random.
        silent_every_s, silent_for_s: it stops for so long, every so often; 0 for never.
    """

    message: str
    rate_hz: float = 30.0
    motion: str = "still"
    position_m: tuple[float, ...] = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    velocity_m_s: tuple[float, ...] = (0.0, 0.0, 0.0)
    radius_m: float = 1.0
    period_s: float = 20.0
    wobble_deg: float = 0.0
    noise_m: float = 0.0
    noise_deg: float = 0.0
    seed: int = 1
    quality: int = 100
    covariance: tuple[float, ...] = ()
    velocity_covariance: tuple[float, ...] = ()
    frames: tuple[float, ...] = (20, 12)
    stamp_offset_s: float = 991.0
    stamp_unit_us: float = 1.0
    drift_ppm: float = 0.0
    delays_ms: tuple[float, ...] = (0.0,)
    random_delay_ms: float = 0.0
    silent_every_s: float = 0.0
    silent_for_s: float = 0.0


_BOUNDS: Final[Mapping[str, tuple[float, float]]] = {
    "rate_hz": (0.1, 400),
    "radius_m": (0, 1e5),
    "period_s": (0.5, 1e5),
    "noise_m": (0, 1e3),
    "noise_deg": (0, 180),
    "stamp_offset_s": (0, 4e9),
    "stamp_unit_us": (1e-3, 1e6),
    "drift_ppm": (-1e5, 1e5),
    "random_delay_ms": (0, 1e4),
    "silent_every_s": (0, _LONGEST_S),
    "silent_for_s": (0, _LONGEST_S),
}
_MOST: Final[Mapping[str, int]] = {"covariance": 21, "velocity_covariance": 21, "delays_ms": 1000}


def _stream_values(given: Fields) -> dict[str, Any]:
    """Return the fields of a stream that are given, except its message."""
    values: dict[str, Any] = {}
    for one in fields(Stream)[1:]:
        name, default = one.name, one.default
        if name not in given:
            continue
        if name == "motion":
            values[name] = given.text(name, among=MOTIONS)
        elif isinstance(default, tuple):
            values[name] = (
                _covariance(given, name) if "covariance" in name else given.numbers(name, default, _MOST.get(name))
            )
        elif isinstance(default, int):
            values[name] = given.whole(name, low=-1, high=100 if name == "quality" else 2**31)
        else:
            values[name] = given.number(name, None, *_BOUNDS.get(name, (-1e9, 1e9)))
    delays = values.get("delays_ms", (0.0,))
    if not delays or min(delays) < 0:
        raise InputError(f"{given.at('delays_ms')}: no delay, or one below 0")
    return values


def _covariance(given: Fields, name: str) -> tuple[float, ...]:
    value = given.take(name)
    if not isinstance(value, list) or len(value) > _MOST[name]:
        raise InputError(f"{given.at(name)}: {value!r} is not a list of at most {_MOST[name]} numbers")
    return tuple(
        one if isinstance(one, float) and math.isnan(one) else number(given.at(name), one, -1e9, 1e9) for one in value
    )


@dataclass(frozen=True, slots=True)
class Pause:
    """Nothing but the streams for a while."""

    duration_s: float


@dataclass(frozen=True, slots=True)
class Start:
    """Streams begin; those that ran before end."""

    streams: tuple[Stream, ...]


@dataclass(frozen=True, slots=True)
class Change:
    """Fields of the streams that run, from now on."""

    values: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Jump:
    """The streams go on elsewhere: NED in m, degrees clockwise; with the reset counter raised or not."""

    position_m: tuple[float, ...]
    yaw_deg: float
    counted: bool


@dataclass(frozen=True, slots=True)
class Dropout:
    """The streams are silent for a while."""

    duration_s: float


@dataclass(frozen=True, slots=True)
class Set:
    """Parameters change in flight."""

    parameters: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Send:
    """One message, by the companion computer."""

    message: Message


@dataclass(frozen=True, slots=True)
class Ask:
    """A question of a ground station; all that is answered within a time is kept.

    ``given`` is the message as the file has it. Messages to ``show`` are kept although they come all the time.
    """

    name: str
    given: list[Any]
    message: Message
    wait_s: float
    show: tuple[str, ...] = ()
    hide: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Until:
    """Wait until something is so, all that is not None.

    Attributes:
        text: a part of a text of the autopilot since the last step that waited began.
        ekf: flags that EKF_STATUS_REPORT has.
        clock_s: that the autopilot's clock shows.
        armed: whether it is armed.
        near_m: NED from the origin, that LOCAL_POSITION_NED tells within ``within_m``.
        timeout_s: how long to wait, by the autopilot's clock.
    """

    text: str | None = None
    ekf: int | None = None
    clock_s: float | None = None
    armed: bool | None = None
    near_m: tuple[float, ...] | None = None
    within_m: float = 0.5
    timeout_s: float = 60.0

    def __str__(self) -> str:
        """Return what is waited for."""
        names = [name for name, flag in EKF_FLAGS.items() if (self.ekf or 0) & flag]
        wanted = (
            self.text is not None and f"text {self.text!r}",
            names and f"EKF flags {', '.join(names)}",
            self.clock_s is not None and f"{self.clock_s:g} s since boot",
            self.armed is not None and ("armed" if self.armed else "disarmed"),
            self.near_m is not None and f"position within {self.within_m:g} m of {list(self.near_m)}",
        )
        return " and ".join(one for one in wanted if one)


Step = Pause | Start | Change | Jump | Dropout | Set | Send | Ask | Until


@dataclass(frozen=True, slots=True)
class Scenario:
    """What to do with an autopilot while it is recorded.

    Attributes:
        name: of the files that come of it.
        about: what happens, for people.
        parameters: to be set before, by name.
        if_there: parameters to be set if the autopilot has them.
        reboot: whether to reboot after that.
        needs_flight: whether it needs a simulated vehicle that flies and tells its truth (SIM_STATE).
        wait: what to wait for before the first step.
        steps: what to do.
    """

    name: str
    about: str
    parameters: Mapping[str, float]
    if_there: Mapping[str, float]
    reboot: bool
    needs_flight: bool
    wait: tuple[Until, ...]
    steps: tuple[Step, ...]

    @property
    def needs_position(self) -> bool:
        """Whether a step asks where the vehicle is."""
        return any(isinstance(step, Until) and step.near_m is not None for step in (*self.wait, *self.steps))

    @property
    def needs_ekf(self) -> bool:
        """Whether a step asks for the estimator's flags."""
        return any(isinstance(step, Until) and step.ekf is not None for step in (*self.wait, *self.steps))


def _until(given: Fields) -> Until:
    ekf = None
    if "ekf" in given:
        names = given.take("ekf")
        if not isinstance(names, list) or not names or not all(name in EKF_FLAGS for name in names):
            raise InputError(f"{given.at('ekf')}: {names!r} is not a list of some of {', '.join(EKF_FLAGS)}")
        ekf = sum(EKF_FLAGS[name] for name in set(names))
    found = Until(
        given.text("text") if "text" in given else None,
        ekf,
        given.number("clock_s", low=0, high=_LONGEST_S) if "clock_s" in given else None,
        given.flag("armed") if "armed" in given else None,
        given.numbers("near_m", (0.0, 0.0, 0.0)) if "near_m" in given else None,
        given.number("within_m", 0.5, 0.01, 1e4),
        given.number("timeout_s", 60.0, 0, _LONGEST_S),
    )
    if not str(found):
        raise InputError(f"{given.place}: nothing to wait for")
    given.end()
    return found


def _read_start(place: str, value: object) -> Step:
    streams = []
    for index, one in enumerate(value if isinstance(value, list) else [value], 1):
        given = Fields(f"{place} {index}", one)
        streams.append(Stream(given.text("message", among=VISION), **_stream_values(given)))
        given.end()
    return Start(tuple(streams))


def _read_change(place: str, value: object) -> Step:
    given = Fields(place, value)
    values = _stream_values(given)
    given.end()
    return Change(values)


def _read_jump(place: str, value: object) -> Step:
    given = Fields(place, value)
    jump = Jump(
        given.numbers("position_m", (0.0, 0.0, 0.0)), given.number("yaw_deg", 0.0, -360, 360), given.flag("counted")
    )
    given.end()
    return jump


def _read_set(place: str, value: object) -> Step:
    return Set(Fields(place, {"set": value}).table("set"))


def _read_command(place: str, value: object) -> Step:
    command, *params = numbers(place, value, None, 8) or (0.0,)
    return Send(COMMAND_LONG(1, 1, int(number(place, command, 0, 65535)), 0, *params, *(0.0,) * (7 - len(params))))


def _read_arm(place: str, value: object) -> Step:
    if not isinstance(value, bool):
        raise InputError(f"{place}: {value!r} is neither true nor false")
    return _read_command(place, [_MAV_CMD_ARM, int(value)])


def _read_sources(place: str, value: object) -> Step:
    return _read_command(place, [_MAV_CMD_SET_EKF_SOURCE_SET, number(place, value, 1, 3)])


def _read_origin(place: str, value: object) -> Step:
    latitude_deg, longitude_deg, altitude_m = numbers(place, value, 3)
    latitude, longitude = (round(one * 1e7) for one in (latitude_deg, longitude_deg))
    return Send(SET_GPS_GLOBAL_ORIGIN(1, latitude, longitude, round(altitude_m * 1e3)))


def _read_ask(place: str, value: object) -> Step:
    given = Fields(place, value)
    name, sent = given.text("name"), given.take("send")
    message = message_of(given.at("send"), sent)
    wait_s = given.number("wait_ms", 150, 1, 60_000) * 1e-3
    show, hide = (_names(given, field) for field in ("show", "hide"))
    given.end()
    return Ask(name, sent, message, wait_s, show, hide)


def _names(given: Fields, name: str) -> tuple[str, ...]:
    value = given.take(name) if name in given else []
    if not isinstance(value, list) or not all(one in MESSAGES for one in value):
        raise InputError(f"{given.at(name)}: {value!r} is not a list of messages")
    return tuple(value)


STEPS: Final[Mapping[str, tuple[Callable[[str, object], Step], str]]] = MappingProxyType(
    {
        "stream": (_read_start, "one stream or a list of them; they run from here on in place of those before"),
        "change": (_read_change, "fields of a stream, which all that run have from here on"),
        "jump": (
            _read_jump,
            "`position_m`, `yaw_deg`, `counted`: streams go on elsewhere, with a new reset count or not",
        ),
        "dropout": (lambda place, value: Dropout(number(place, value, 0, _LONGEST_S)), "seconds of silence"),
        "pause": (lambda place, value: Pause(number(place, value, 0, _LONGEST_S)), "seconds in which streams run"),
        "set": (_read_set, "parameters by name, set by PARAM_SET"),
        "command": (_read_command, "number and up to 7 parameters of a COMMAND_LONG"),
        "arm": (_read_arm, "true or false: a try to arm or disarm"),
        "sources": (_read_sources, "1 to 3: switch to that set of sources"),
        "origin": (_read_origin, "latitude and longitude in degrees, altitude in m: SET_GPS_GLOBAL_ORIGIN"),
        "send": (
            lambda place, value: Send(message_of(place, value)),
            "`[MESSAGE, {field: value}]`, fields left out are 0",
        ),
        "ask": (
            _read_ask,
            "`name`, `send`, `wait_ms` (150), `show`, `hide`: a question of a ground station; answers are kept",
        ),
        "until": (
            lambda place, value: _until(Fields(place, value)),
            "`text`, `ekf` flags, `clock_s` since boot, `armed`, `near_m` (NED) and `within_m`; at most `timeout_s`",
        ),
    }
)
"""How each kind of step is read, and what it takes."""


def _read_step(place: str, value: object) -> Step:
    if not isinstance(value, dict) or len(value) != 1:
        raise InputError(f"{place}: {value!r} is not one step with what it takes")
    [(name, inner)] = value.items()
    if name not in STEPS:
        raise InputError(f"{place}: {name}: no such step; there are {', '.join(STEPS)}")
    step = STEPS[name][0](f"{place}: {name}", inner)
    if isinstance(step, Send | Ask):
        try:
            Codec(1, 1).encode(step.message)
        except Exception as error:  # struct.error, TypeError and others, as pymavlink happens to raise
            raise InputError(f"{place}: {name}: a field does not fit its type: {error}") from error
    return step


def _list(given: Fields, name: str) -> list[Any]:
    value = given.take(name) if name in given else []
    if not isinstance(value, list):
        raise InputError(f"{given.at(name)}: {value!r} is not a list")
    return value


def parse_scenario(text: str, source: str) -> Scenario:
    """Return what a text in YAML says. Raises InputError that names the source and the field."""
    try:
        document = parsed_yaml(text)
    except ValueError as error:
        raise InputError(f"{source}: {error}") from None
    given = Fields(source, document)
    name = given.text("name")
    if not name or not all(one.isalnum() or one in "-_." for one in name) or name.startswith("."):
        raise InputError(f"{given.at('name')}: {name!r} is no name for files: letters, digits, - and _")
    wait = [_until(Fields(f"{source}: wait {index}", one)) for index, one in enumerate(_list(given, "wait"), 1)]
    steps = [_read_step(f"{source}: step {index}", one) for index, one in enumerate(_list(given, "steps"), 1)]
    scenario = Scenario(
        name,
        " ".join(given.text("about").split()),
        given.table("parameters"),
        given.table("if_there"),
        given.flag("reboot", True),
        given.flag("needs_flight"),
        tuple(wait),
        tuple(steps),
    )
    given.end()
    if not steps:
        raise InputError(f"{given.at('steps')}: missing, or empty")
    truth = any(isinstance(step, Start) and any(one.motion == "truth" for one in step.streams) for step in steps)
    if truth and not scenario.needs_flight:
        raise InputError(f"{given.at('needs_flight')}: motion 'truth' needs it to be true")
    return scenario


def read_scenario(name: str) -> Scenario:
    """Return a scenario by its name or the path of its file. Raises InputError."""
    path = SCENARIOS.get(name) or Path(name)
    if name not in SCENARIOS and not path.suffix and not path.exists():
        raise InputError(f"SCENARIO {name}: neither a file nor one of {', '.join(SCENARIOS)}")
    with file_errors(path):
        data = path.read_bytes()
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: byte {error.start}: not UTF-8") from None
    return parse_scenario(text, str(path))
