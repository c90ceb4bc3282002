# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages by which a simulator gives the vehicle its sensors."""

from types import SimpleNamespace
from typing import cast

import pytest

from ap_core.verdict import Verdict
from mav_handlers.channel import Context
from mav_handlers.handlers import HANDLERS
from mav_handlers.verdicts import HANDLED, NO_HIL_INPUT
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import HIL_SENSOR, HIL_STATE_QUATERNION, Message
from viso.vehicle.sensors.source import ImuOptions, VehicleSource

SENSOR = HIL_SENSOR(
    12_345_678, 0.25, -0.5, -9.75, 0.125, 0.0, -0.5, 0.25, 0.0, 0.5, 1013.25, 0.0, 488.5, 20.0, 0x1FFF, 2
)
STATE = HIL_STATE_QUATERNION(
    12_345_678,
    (0.5, 0.5, -0.5, 0.5),
    0.125,
    0.25,
    -0.5,
    473977418,
    85455938,
    488_000,
    100,
    -200,
    300,
    0,
    0,
    1,
    -2,
    -1000,
)


NOW_US = 12_500


class Simulator(VehicleSource):
    """Remembers what it was given, and when."""

    def __init__(self) -> None:
        super().__init__(ImuOptions())
        self.given: list[tuple[Message, int]] = []

    def take_hil_sensor(self, message: HIL_SENSOR, now_us: int) -> bool:
        self.given.append((message, now_us))
        return True

    def take_hil_state(self, message: HIL_STATE_QUATERNION, now_us: int) -> bool:
        self.given.append((message, now_us))
        return True


def handle(source: VehicleSource, message: Message) -> Verdict:
    context = SimpleNamespace(vehicle=SimpleNamespace(source=source), now_us=NOW_US)
    return HANDLERS[type(message)](cast("Context", context), message)


@pytest.mark.parametrize("message", [SENSOR, STATE], ids=lambda message: type(message).__name__)
class TestHil:
    """HIL_SENSOR and HIL_STATE_QUATERNION."""

    def test_vehicle_with_hil_input_takes_it(self, message: Message) -> None:
        simulator = Simulator()
        assert handle(simulator, message) is HANDLED
        assert simulator.given == [(message, NOW_US)]

    def test_it_is_dropped_by_any_other(self, message: Message) -> None:
        assert handle(VehicleSource(ImuOptions()), message) is NO_HIL_INPUT

    def test_it_comes_over_the_wire_as_it_was_sent(self, message: Message) -> None:
        codec = Codec(255, 190)
        codec.feed(codec.encode(message))
        received = codec.next_received()
        assert isinstance(received, Received)
        assert received.message == message


def test_reason_names_what_to_do() -> None:
    assert NO_HIL_INPUT.rule.text == "no HIL input; serve with --imu hil"
