# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversations with the autopilot: what each release answers to whatever a client may ask."""

import dataclasses
import json
import math
from collections.abc import Iterator
from functools import cache
from typing import Any, Final

import pytest

from mav_handlers.wire import messages
from mav_handlers.wire.codec import BadData, Codec
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE, Message
from tests.places import DATA
from viso.firmware.releases import APRIL_2026, FEBRUARY_2026, PROFILES, REFERENCE
from viso.running.virtual_time import Scheduler
from viso.vehicle.vehicle import Vehicle, VehicleConfig

CONVERSATIONS = DATA / "conversations"
NAMES = ("parked", "camera")
UNASKED: Final = frozenset({"HEARTBEAT", "TIMESYNC"})
WAIT_MS = 150
PAYLOAD_BYTES = 251
NUMBERS: Final = {"nan": math.nan, "inf": math.inf}

Exchange = dict[str, Any]


@cache
def read_conversation(name: str) -> tuple[Exchange, tuple[Exchange, ...]]:
    """Return what a conversation begins with, and its exchanges."""
    lines = (CONVERSATIONS / f"{name}.jsonl").read_text(encoding="ascii").splitlines()
    head, *exchanges = map(json.loads, lines)
    return head, tuple(exchanges)


def number(value: Any) -> Any:
    return NUMBERS.get(value, value) if isinstance(value, str) else value


def build(name: str, given: dict[str, Any]) -> Message:
    """Return a message; fields that are not given are zero or empty."""
    kind = getattr(messages, name)
    values = {}
    for field in dataclasses.fields(kind):
        if field.name in given:
            values[field.name] = sendable(field.name, given[field.name])
        elif field.default is dataclasses.MISSING:
            values[field.name] = "" if field.type in (str, "str") else 0
    return kind(**values)  # type: ignore[no-any-return]  # looked up by its name


def sendable(field: str, value: Any) -> Any:
    if field == "payload":
        return tuple(bytes.fromhex(value).ljust(PAYLOAD_BYTES, b"\0"))
    return tuple(map(number, value)) if isinstance(value, list) else number(value)


def is_equal(wanted: Any, got: Any) -> bool:
    """Tell whether a field holds what is wanted: bytes that begin with some, or numbers of float32."""
    if isinstance(got, tuple) and isinstance(wanted, str):
        return bytes(got).startswith(bytes.fromhex(wanted))
    if isinstance(got, tuple):
        return len(got) == len(wanted) and all(map(is_equal, wanted, got))
    if isinstance(got, float):
        return bool(got == pytest.approx(number(wanted), rel=1e-6, nan_ok=True))
    return bool(wanted == got)


def is_answer(wanted: tuple[str, dict[str, Any]], got: Message) -> bool:
    name, fields = wanted
    return type(got).__name__ == name and all(is_equal(value, getattr(got, field)) for field, value in fields.items())


SAME_AS = {APRIL_2026.name: FEBRUARY_2026.name}
"""Releases that answer as an earlier one does, but for their version."""


class Conversation:
    """A vehicle of a release, and a client that talks to it in virtual time."""

    def __init__(self, head: Exchange, firmware: str) -> None:
        self._firmware = firmware
        vehicle = Vehicle(VehicleConfig(defaults=head["params"], firmware=PROFILES[firmware]))
        self._channel = vehicle.endpoint.open_channel("client")
        self._scheduler = Scheduler(vehicle)
        self._sender, self._reader = Codec(255, 190), Codec(255, 190)
        self._period_us = round(1e6 / head["camera_hz"]) if head["camera_hz"] else 0
        self._scheduler.run_until(round(head["begins_s"] * 1e6))
        self._channel.take_output()

    def _send(self, message: Message) -> None:
        self._scheduler.deliver(self._channel, self._sender.encode(message))

    def _wait(self, duration_ms: int) -> None:
        end_us = self._scheduler.now_us + duration_ms * 1000
        while self._period_us and self._scheduler.now_us + self._period_us <= end_us:
            now_us = self._scheduler.now_us + self._period_us
            self._scheduler.run_until(now_us)
            self._send(VISION_POSITION_ESTIMATE(now_us, 1.0, 2.0, 0.0, 0.0, 0.0, 0.0))
            self._send(VISION_SPEED_ESTIMATE(now_us, 0.0, 0.0, 0.0))
        self._scheduler.run_until(end_us)

    def _received(self) -> Iterator[Message]:
        self._reader.feed(self._channel.take_output())
        while (received := self._reader.next_received()) is not None:
            assert not isinstance(received, BadData)
            assert received.message is not None
            yield received.message

    def _wanted(self, exchange: Exchange) -> Any:
        firmware = SAME_AS.get(self._firmware, self._firmware)
        wanted = exchange.get("answers of", {}).get(firmware, exchange["answers"])
        if firmware == self._firmware:
            return wanted
        text, before, own = json.dumps(wanted), PROFILES[firmware], PROFILES[self._firmware]
        text = text.replace(str(before.sw_version), str(own.sw_version)).replace(before.banner, own.banner)
        old_hash, own_hash = (json.dumps(list(one.source_hash.encode())) for one in (before, own))
        return json.loads(text.replace(old_hash, own_hash))

    def difference(self, exchange: Exchange) -> str | None:
        """Send what an exchange says; return how the answers differ from those it wants, or None."""
        self._send(build(*exchange["send"]))
        self._wait(exchange.get("wait_ms", WAIT_MS))
        hidden = UNASKED - set(exchange.get("also show", ())) | set(exchange.get("hide", ()))
        got = [message for message in self._received() if type(message).__name__ not in hidden]
        wanted = self._wanted(exchange)
        if len(wanted) == len(got) and all(map(is_answer, wanted, got)):
            return None
        return f"{exchange['name']} ({exchange['why']}): wanted {wanted}, got {got}"


# Of 4.6 there are no recordings: it answers as the reference does, under other names. And of the long conversation, the
# usual run has the reference's answers.
USUAL = {("parked", REFERENCE.name), ("camera", REFERENCE.name), ("camera", FEBRUARY_2026.name)}
CASES = [
    pytest.param(name, firmware, marks=() if (name, firmware) in USUAL else pytest.mark.slow)
    for name in NAMES
    for firmware in PROFILES
]


@pytest.mark.parametrize(("name", "firmware"), CASES)
def test_every_release_answers_as_it_is_specified(name: str, firmware: str) -> None:
    head, exchanges = read_conversation(name)
    conversation = Conversation(head, firmware)
    differences = [conversation.difference(exchange) for exchange in exchanges]
    assert [difference for difference in differences if difference is not None] == []


def test_conversations_are_long_and_each_exchange_has_its_reason() -> None:
    exchanges = [exchange for name in NAMES for exchange in read_conversation(name)[1]]
    assert len(exchanges) > 220
    assert all(exchange["why"] for exchange in exchanges)
    assert len({exchange["name"] for exchange in exchanges}) > 210


def test_releases_are_told_apart() -> None:
    exchanges = [exchange for name in NAMES for exchange in read_conversation(name)[1]]
    different = [exchange.get("answers of", {}) for exchange in exchanges]
    assert sum("2026-02" in answers for answers in different) > 25
    assert sum("4.6" in answers for answers in different) > 15


def test_answers_of_another_release_are_not_taken() -> None:
    head, exchanges = read_conversation("parked")
    conversation = Conversation(head, "4.7-dev")
    of_later = [
        {**exchange, "answers": exchange["answers of"]["2026-02"], "answers of": {}}
        for exchange in exchanges[:45]
        if "2026-02" in exchange.get("answers of", {})
    ]
    assert len(of_later) > 10
    assert all(conversation.difference(exchange) is not None for exchange in of_later)
