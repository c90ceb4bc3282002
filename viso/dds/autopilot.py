# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The autopilot as a member of a ROS 2 graph: its services, and topics, which it keeps over restarts of the vehicle.

Source: AP_DDS/AP_DDS_Service_Table.h, AP_DDS/AP_DDS_Client.cpp, on_request.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from ap_core.verdict import Verdict
from mav_handlers.channel import CountKey
from mav_handlers.dds import Transform, receive_transforms
from mav_handlers.endpoint import MessageEvent
from mav_handlers.verdicts import HANDLED, TF_UNREADABLE
from viso.dds import messages as ros
from viso.dds.graph import LATCHED, SENSOR_DATA, Participant, Reader
from viso.dds.messages import TFMessage, TransformStamped
from viso.dds.topics import STATIC_TF, TOPICS, static_transforms
from viso.vehicle.copter.arming import ArmMethod
from viso.vehicle.copter.modes import ModeReason
from viso.vehicle.vehicle import Vehicle

_MAV_SEVERITY_INFO: Final = 6


def _send_text(vehicle: Vehicle, text: str) -> None:
    vehicle.texts.send_text(_MAV_SEVERITY_INFO, f"DDS: Request for {text}")


def _result(worked: bool) -> str:
    return "SUCCESS" if worked else "FAIL"


def _arm(vehicle: Vehicle, request: ros.ArmMotorsRequest) -> ros.ArmMotorsResponse:
    _send_text(vehicle, f"{'arm' if request.arm else 'disarm'}ing received")
    copter = vehicle.copter
    worked = copter.arm(True, ArmMethod.DDS) if request.arm else copter.disarm(False, ArmMethod.DDS)
    _send_text(vehicle, f"Arming/Disarming : {_result(worked)}")
    return ros.ArmMotorsResponse(request.id, worked)


def _switch_mode(vehicle: Vehicle, request: ros.ModeSwitchRequest) -> ros.ModeSwitchResponse:
    worked = vehicle.copter.set_mode(request.mode, ModeReason.DDS_COMMAND)
    _send_text(vehicle, f"Mode Switch : {_result(worked)}")
    return ros.ModeSwitchResponse(request.id, worked, vehicle.copter.custom_mode())


def _check(vehicle: Vehicle, request: ros.TriggerRequest) -> ros.TriggerResponse:
    passed = vehicle.copter.arming.pre_arm_checks(display=False)
    return ros.TriggerResponse(request.id, passed, "Vehicle is Armable" if passed else "Vehicle is Not Armable")


class Service(NamedTuple):
    """A service: its name, what is asked and answered, and what answers."""

    name: str
    request: type[Any]
    reply: type[Any]
    answer: Callable[[Vehicle, Any], Any]


SERVICES: Final = (
    Service("/ap/arm_motors", ros.ArmMotorsRequest, ros.ArmMotorsResponse, _arm),
    Service("/ap/mode_switch", ros.ModeSwitchRequest, ros.ModeSwitchResponse, _switch_mode),
    Service("/ap/prearm_check", ros.TriggerRequest, ros.TriggerResponse, _check),
)
"""In the firmware's order."""


TF: Final = "/ap/tf"
TRANSFORMS: Final = "TFMessage"
NO_CHANNEL: Final = -1


def transform_of(message: TransformStamped) -> Transform:
    """Return a transform as the autopilot takes it."""
    place, turn = message.transform.translation, message.transform.rotation
    return Transform(
        message.header.frame_id,
        message.child_frame_id,
        message.header.stamp.sec,
        message.header.stamp.nanosec,
        (place.x, place.y, place.z),
        (turn.x, turn.y, turn.z, turn.w),
    )


class DdsAutopilot:
    """Reads /ap/tf and requests, and writes the topics of the autopilot, in real time; ``domain`` is ROS_DOMAIN_ID.

    Attributes:
        name: its name among the links.
        listeners: called with that name and the outcome of each transform and each request.
        counts: how often each kind met each verdict.
    """

    def __init__(self, domain: int) -> None:
        self.name = f"dds:{domain}"
        self.listeners: Sequence[Callable[[str, MessageEvent], None]] = ()
        self.counts: Counter[CountKey] = Counter()
        self._graph = Participant(domain)
        self._transforms: Reader[TFMessage] = self._graph.reader(TF, TFMessage, SENSOR_DATA)
        self._damaged = 0
        self._static = self._graph.writer(STATIC_TF, TFMessage, LATCHED)
        self._topics = [(topic, self._graph.writer(topic.name, topic.message, topic.qos)) for topic in TOPICS]
        self._services = [
            (service, *self._graph.server(service.name, service.request, service.reply)) for service in SERVICES
        ]
        self._vehicle: Vehicle | None = None
        self._messages: list[Any] = []
        self._last_ms = [0] * len(TOPICS)

    @property
    def readers(self) -> Sequence[Reader[Any]]:
        """The readers that a loop waits for."""
        return self._transforms, *(requests for _, requests, _ in self._services)

    def due_us(self) -> int:
        """Return when a topic is due next, us since boot."""
        dues = (last + topic.delay_ms + 1 for last, (topic, _) in zip(self._last_ms, self._topics, strict=True))
        return min(dues) * 1000

    def exchange(self, vehicle: Vehicle) -> None:
        """Pass what has come to the vehicle, and write the topics that are due by the clock of the vehicle."""
        if vehicle is not self._vehicle:
            self._begin(vehicle)
        self._take(vehicle)
        self._serve(vehicle)
        if vehicle.clock.micros64() >= self.due_us():
            self._write(vehicle)

    def _begin(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._messages = [topic.message() for topic in TOPICS]
        self._last_ms = [0] * len(TOPICS)
        self._static.write(static_transforms(vehicle))

    def _take(self, vehicle: Vehicle) -> None:
        for message in self._transforms.take():
            for verdict in receive_transforms(vehicle, [transform_of(each) for each in message.transforms]):
                self._note(vehicle, TRANSFORMS, verdict)
        while self._damaged < self._transforms.damaged:
            self._damaged += 1
            self._note(vehicle, TRANSFORMS, TF_UNREADABLE)

    def _serve(self, vehicle: Vehicle) -> None:
        for service, requests, replies in self._services:
            for request in requests.take():
                replies.write(service.answer(vehicle, request))
                self._note(vehicle, service.name, HANDLED)

    def _note(self, vehicle: Vehicle, name: str, verdict: Verdict) -> None:
        self.counts[name, verdict.kind, verdict.rule.code] += 1
        event = MessageEvent(NO_CHANNEL, vehicle.clock.micros64(), name, None, None, verdict)
        for listener in self.listeners:
            listener(self.name, event)

    def _write(self, vehicle: Vehicle) -> None:
        """Write every topic that is due, as a thread would that looks each millisecond (AP_DDS_Client::update)."""
        now_ms = vehicle.clock.micros64() // 1000
        for index, (topic, writer) in enumerate(self._topics):
            late_ms = now_ms - self._last_ms[index] - topic.delay_ms - 1
            if late_ms >= 0:
                self._last_ms[index] = now_ms - (late_ms if late_ms < topic.delay_ms else 0)
                if topic.update(vehicle, self._messages[index]):
                    writer.write(self._messages[index])

    def close(self) -> None:
        """Leave the graph."""
        self._graph.close()
