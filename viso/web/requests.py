# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What pages ask for, and how it is done: as a message of a ground station, by the vehicle's own handlers.

A page is no peer on a link: its messages go straight to the handlers, and answers go to it alone. What the firmware
sends to every link because of it, such as the new value of a parameter, is sent to every link.
"""

import math
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, Generic, TypeVar

import numpy as np

from ap_core.param_info import MAX_NAME_SIZE
from ap_core.verdict import VerdictKind
from mav_handlers.channel import Channel, Context
from mav_handlers.handlers.commands import MavCmd, MavResult, handle_command_long
from mav_handlers.handlers.params import handle_param_set
from mav_handlers.verdicts import HANDLED
from mav_handlers.wire.codec import Codec, Header, Received, message_id
from mav_handlers.wire.messages import COMMAND_ACK, COMMAND_LONG, PARAM_SET, Message
from viso.documents import parsed_json
from viso.vehicle.vehicle import Vehicle
from viso.web.faults import FaultSwitches

T = TypeVar("T")


class BoundedQueue(Generic[T]):
    """Holds the newest items that were not taken yet; beyond a limit the oldest are lost, and counted."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._waiting: deque[T] = deque()
        self._lock = threading.Lock()
        self.lost = 0

    def __len__(self) -> int:
        """Return how many items wait."""
        return len(self._waiting)

    def put(self, item: T) -> None:
        """Add an item."""
        with self._lock:  # the other side holds it for two assignments only
            if len(self._waiting) >= self._limit:
                self._waiting.popleft()
                self.lost += 1
            self._waiting.append(item)

    def put_if_room(self, item: T) -> bool:
        """Add an item if there is room; return whether it was added."""
        with self._lock:
            if len(self._waiting) >= self._limit:
                return False
            self._waiting.append(item)
            return True

    def take_all(self) -> deque[T]:
        """Remove and return all items, the oldest first."""
        with self._lock:
            taken, self._waiting = self._waiting, deque()
        return taken


GCS_SYSTEM_ID: Final = 255
GCS_COMPONENT_ID: Final = 190
MAX_REQUEST_CHARS: Final = 2000
REQUESTS_WAITING: Final = 200
_MAV_PARAM_TYPE_REAL32: Final = 9
_ALIGN_YAW, _SWITCH_HIGH = 80.0, 2.0
_LARGEST_NUMBER: Final = 2**31


@dataclass(frozen=True, slots=True)
class Action:
    """A button of the page, asked for by its name; ``params`` are the first of the command, ``key`` does the same."""

    name: str
    label: str
    about: str
    key: str
    command: MavCmd
    params: tuple[float, ...] = ()


ACTIONS: Final = (
    Action(
        "align", "Align yaw", "Turn the camera's yaw to the vehicle's (auxiliary function 80).", "y",
        MavCmd.DO_AUX_FUNCTION, (_ALIGN_YAW, _SWITCH_HIGH),
    ),
    Action("check", "Check", "Make all pre-arm checks, and report what fails.", "c", MavCmd.RUN_PREARM_CHECKS),
    Action("arm", "Arm", "Arm, if the checks pass; there are no motors.", "a", MavCmd.COMPONENT_ARM_DISARM, (1.0,)),
    Action("disarm", "Disarm", "Disarm.", "d", MavCmd.COMPONENT_ARM_DISARM, (0.0,)),
    Action("source1", "Source 1", "Navigate by the first set, EK3_SRC1.", "1", MavCmd.SET_EKF_SOURCE_SET, (1.0,)),
    Action("source2", "Source 2", "Navigate by the second set, EK3_SRC2.", "2", MavCmd.SET_EKF_SOURCE_SET, (2.0,)),
    Action("source3", "Source 3", "Navigate by the third set, EK3_SRC3.", "3", MavCmd.SET_EKF_SOURCE_SET, (3.0,)),
    Action(
        "restart", "Restart", "Restart the autopilot; parameters are kept.", "",
        MavCmd.PREFLIGHT_REBOOT_SHUTDOWN, (1.0,),
    ),
)  # fmt: skip
_ACTIONS: Final[Mapping[str, Action]] = MappingProxyType({action.name: action for action in ACTIONS})
_RESULTS: Final[Mapping[int, str]] = MappingProxyType(
    {
        MavResult.ACCEPTED: "done",
        MavResult.TEMPORARILY_REJECTED: "not now",
        MavResult.DENIED: "denied",
        MavResult.UNSUPPORTED: "not supported",
        MavResult.FAILED: "refused; the texts say why",
    }
)


class RequestError(ValueError):
    """A request that cannot be read; the text says why, in one line."""


@dataclass(frozen=True, slots=True)
class Request:
    """A request of a page: its kind (``param``, ``action`` or ``fault``), and a number, -1 without one."""

    client: int
    number: int
    kind: str
    name: str
    value: float = math.nan
    on: bool = False


@dataclass(frozen=True, slots=True)
class Answer:
    """The outcome of a request, with its client and number: whether it was carried out, and a text."""

    client: int
    request: int
    ok: bool
    text: str


def number_of(text: str) -> int:
    """Return the number that a request may bear, for an answer to one that is otherwise of no use; -1 without."""
    try:
        return _number(_object(text))
    except RequestError:
        return -1


def asks_for_diagnosis(text: str) -> bool:
    """Return whether a page asks for the doctor, which needs no vehicle."""
    try:
        return _object(text).get("do") == "diagnose"
    except RequestError:
        return False


def parse_request(client: int, text: str) -> Request:
    """Return what a page asks for. Raises RequestError if it is nothing that can be asked for."""
    fields = _object(text)
    number, kind, name = _number(fields), fields.get("do"), fields.get("name")
    if not isinstance(name, str) or not 0 < len(name) <= MAX_NAME_SIZE or not name.isprintable():
        raise RequestError("name: missing, or no name")
    if kind == "param":
        return Request(client, number, kind, name, value=_value(fields.get("value")))
    if kind == "action" and name in _ACTIONS:
        return Request(client, number, kind, name)
    if kind == "fault" and isinstance(fields.get("on"), bool):
        return Request(client, number, kind, name, on=fields["on"])
    raise RequestError("nothing that can be done here")


def _object(text: str) -> Mapping[str, Any]:
    if len(text) > MAX_REQUEST_CHARS:
        raise RequestError("too long")
    try:
        fields = parsed_json(text)
    except ValueError:
        raise RequestError("not JSON") from None
    if not isinstance(fields, dict):
        raise RequestError("not an object")
    return fields


def _number(fields: Mapping[str, Any]) -> int:
    number = fields.get("id", -1)
    if type(number) is not int or abs(number) > _LARGEST_NUMBER:
        raise RequestError("id: no number")
    return number


def _value(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise RequestError("value: no number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise RequestError("value: not finite")
    return number


class RequestQueue:
    """The requests that wait: they come in on one thread, and are carried out on the thread of the vehicle."""

    def __init__(self, faults: FaultSwitches) -> None:
        self._faults = faults
        self._waiting: BoundedQueue[Request] = BoundedQueue(REQUESTS_WAITING)
        self._channel: tuple[Vehicle, Channel] | None = None

    def ask(self, client: int, text: str) -> Answer | None:
        """Add a request that a page has sent; return an answer at once if it cannot be carried out."""
        try:
            request = parse_request(client, text)
        except RequestError as error:
            return Answer(client, number_of(text), False, str(error))
        if not self._waiting.put_if_room(request):
            return Answer(client, request.number, False, "too much at once")
        return None

    def run(self, vehicle: Vehicle) -> Iterator[Answer]:
        """Carry out the requests that wait, and yield the answers; between two passes of the vehicle's loop."""
        if not len(self._waiting):
            return
        for request in self._waiting.take_all():
            ok, text = self._do(vehicle, request)
            yield Answer(request.client, request.number, ok, text)

    def _do(self, vehicle: Vehicle, request: Request) -> tuple[bool, str]:
        if request.kind == "fault":
            ok = self._faults.set(request.name, on=request.on)
            return ok, f"fault {'on' if request.on else 'off'}" if ok else "no such fault"
        if request.kind == "param":
            return self._set_param(vehicle, request)
        return self._command(vehicle, _ACTIONS[request.name])

    def _set_param(self, vehicle: Vehicle, request: Request) -> tuple[bool, str]:
        with np.errstate(over="ignore"):
            value = float(np.float32(request.value))
        message = PARAM_SET(0, 0, request.name, value, _MAV_PARAM_TYPE_REAL32)
        verdict = handle_param_set(self._context(vehicle, message), message)
        self._replies(vehicle)
        if verdict is not HANDLED:
            return False, verdict.rule.text
        param = vehicle.params.find(request.name)
        return True, f"{request.name} is {'set' if param is None else param.value}"

    def _command(self, vehicle: Vehicle, action: Action) -> tuple[bool, str]:
        seven = (*action.params, *(0.0,) * 7)[:7]
        message = COMMAND_LONG(0, 0, action.command, 0, *seven)
        verdict = handle_command_long(self._context(vehicle, message), message)
        results = [reply.result for reply in self._replies(vehicle) if isinstance(reply, COMMAND_ACK)]
        ok = verdict.kind is VerdictKind.HANDLED and results == [MavResult.ACCEPTED]
        return ok, f"{action.label}: {_RESULTS.get(results[-1] if results else -1, 'failed')}"

    def _context(self, vehicle: Vehicle, message: Message) -> Context:
        name = type(message).__name__
        header = Header(name, message_id(name), GCS_SYSTEM_ID, GCS_COMPONENT_ID, 0, 2, b"")
        now_us = vehicle.clock.micros64()
        return Context(vehicle, self._own_channel(vehicle), header, now_us, now_us)

    def _own_channel(self, vehicle: Vehicle) -> Channel:
        # It is none of the endpoint's: nothing is sent on it but answers.
        if self._channel is None or self._channel[0] is not vehicle:
            self._channel = vehicle, Channel(-1, "page", Codec(1, 1))
        return self._channel[1]

    def _replies(self, vehicle: Vehicle) -> list[Message]:
        decoder = Codec(GCS_SYSTEM_ID, GCS_COMPONENT_ID)
        decoder.feed(self._own_channel(vehicle).take_output())
        replies = []
        while (received := decoder.next_received()) is not None:
            if isinstance(received, Received) and received.message is not None:
                replies.append(received.message)
        return replies
