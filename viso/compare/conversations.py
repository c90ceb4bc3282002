# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversations: requests of a client are sent to a vehicle again; its answers are compared with the recorded ones."""

import json
import math
import struct
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE, VISION_SPEED_ESTIMATE, Message
from viso.compare.comparison import Comparison
from viso.compare.differences import ABSENT, Difference, Row, row_differences
from viso.compare.tolerances import CONVERSATION, TIMES, tolerances_of
from viso.documents import parsed_json
from viso.errors import InputError
from viso.files.text_files import read_lines
from viso.firmware.releases import JULY_2025, PROFILES, Firmware
from viso.recording.fields import message_of
from viso.running.virtual_time import Scheduler
from viso.streams.capture import MAX_PARAMETER
from viso.vehicle.vehicle import Vehicle, VehicleConfig

WAIT_MS: Final = 150
"""The wait for answers if an exchange has no ``wait_ms``."""

UNASKED: Final = frozenset({"HEARTBEAT", "TIMESYNC"})
"""Messages that come all the time; they count only in an exchange that has them in ``also show``."""

_OF_FLOATS: Final = tolerances_of(CONVERSATION)["float"]
_NUMBERS: Final = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}

Exchange = Mapping[str, Any]


def read_conversation(path: Path) -> tuple[Exchange, list[Exchange]]:
    """Return the head of a conversation, and its exchanges. Raises InputError that names file, line and field."""
    head: Exchange = {}
    exchanges: list[Exchange] = []
    for number, text in read_lines(path):
        try:
            line = parsed_json(text)
            if not head:
                _check(line, {"params": dict})
                _check_number(line, "begins_s", 86_400)
                _check_number(line, "camera_hz", 1000)
                for name in line["params"]:
                    _check_number(line["params"], name, MAX_PARAMETER, least=-MAX_PARAMETER)
                head = line
            else:
                _check(line, {"name": str, "send": list, "answers": list})
                _check_answers(line)
                _check_number({"wait_ms": WAIT_MS} | line, "wait_ms", 3_600_000)
                for field in ("also show", "hide"):
                    _check({field: []} | line, {field: list})
                _check_request(f"{path}:{number}: 'send'", line["send"])
                exchanges.append(line)
        except ValueError as error:
            raise InputError(f"{path}:{number}: {error}") from error
    return head, exchanges


def _check(line: Any, fields: Mapping[str, Any]) -> None:
    for field, kind in fields.items():
        if not isinstance(line, dict) or not isinstance(line.get(field), kind):
            raise ValueError(f"{field!r} is missing or of another kind")


def _check_number(line: Any, field: str, most: float, least: float = 0.0) -> None:
    value = line.get(field)
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ValueError(f"{field!r} is no number from {least:g} to {most:g}: {value!r}")


def _check_request(place: str, request: Any) -> None:
    message = message_of(place, request)
    try:
        Codec(0, 0).encode(message)
    except (struct.error, TypeError, AttributeError) as error:
        raise InputError(f"{place} does not fit {request[0]}: {error}") from error


def _check_answers(line: Exchange) -> None:
    others = line.get("answers of", {})
    if not isinstance(others, dict):
        raise ValueError("'answers of' is not an object")
    for answers in (line["answers"], *others.values()):
        pairs = isinstance(answers, list) and all(isinstance(answer, list) and len(answer) == 2 for answer in answers)
        if not pairs or not all(isinstance(name, str) and isinstance(fields, dict) for name, fields in answers):
            raise ValueError("'answers' is not a list of pairs of a message's name and its fields")


class Conversation:
    """A vehicle of a release, and a client that talks to it in virtual time.

    ``specified`` are the releases that the exchanges name, if they say what each release answers: the reference, and
    others where they answer otherwise. Later ones answer as these but for their version. It is empty for exchanges that
    say what one release has answered.
    """

    def __init__(self, head: Exchange, firmware: Firmware, specified: Collection[str] = ()) -> None:
        self._firmware = self._specified = firmware
        if specified:
            up_to = list(PROFILES.values())[: list(PROFILES).index(firmware.name) + 1]
            self._specified = [firmware, *(profile for profile in up_to if profile.name in specified)][-1]
        vehicle = Vehicle(VehicleConfig(defaults=head["params"], firmware=firmware))
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
            if isinstance(received, Received) and received.message is not None:
                yield received.message

    def _wanted(self, exchange: Exchange) -> Any:
        own, before = self._firmware, self._specified
        wanted = exchange.get("answers of", {}).get(before.name, exchange["answers"])
        if before is own:
            return wanted
        text = json.dumps(wanted)
        text = text.replace(str(before.sw_version), str(own.sw_version)).replace(before.banner, own.banner)
        old_hash, own_hash = (json.dumps(list(table.source_hash.encode())) for table in (before, own))
        return json.loads(text.replace(old_hash, own_hash))

    def ask(self, exchange: Exchange) -> tuple[Sequence[tuple[str, Mapping[str, Any]]], Sequence[Message]]:
        """Send the message of an exchange; return the recorded answers, and those that came."""
        self._send(message_of("'send'", exchange["send"]))
        self._wait(exchange.get("wait_ms", WAIT_MS))
        hidden = [*exchange.get("hide", ()), *(name for name in UNASKED if name not in exchange.get("also show", ()))]
        return self._wanted(exchange), [message for message in self._received() if type(message).__name__ not in hidden]


def answer_differences(
    place: str, wanted: Sequence[tuple[str, Mapping[str, Any]]], got: Sequence[Message]
) -> Iterator[Difference]:
    """Yield what differs in the answers of an exchange, in the fields that the recorded ones have."""
    recorded = [
        Row(name, {label: _number(value) for label, value in fields.items() if label not in TIMES})
        for name, fields in wanted
    ]
    # If the messages differ in type, only their names are compared.
    labels = [row.values for row in recorded] if len(got) == len(recorded) else [{} for _ in got]
    ours = [
        Row(type(message).__name__, {label: _answered(message, label, value) for label, value in values.items()})
        for message, values in zip(got, labels, strict=True)
    ]
    floats = {
        f"{row.record}.{label}": _OF_FLOATS
        for row in ours
        for label, value in row.values.items()
        if isinstance(value[0] if isinstance(value, tuple) else value, float)
    }
    yield from row_differences(place, recorded, ours, floats, units={}, names="answers")


def _number(value: Any) -> Any:
    """Return a value of JSON, where "nan" and "inf" stand for numbers."""
    if isinstance(value, list):
        return [_number(item) for item in value]
    return _NUMBERS.get(value, value) if isinstance(value, str) else value


def _answered(message: Message, label: str, wanted: Any) -> Any:
    """Return a field of an answer in recorded form: bytes in hex, cut to the recorded length."""
    value = getattr(message, label, ABSENT)
    if isinstance(value, tuple) and isinstance(wanted, str):
        data = bytes(value).hex()
        return wanted if data.startswith(wanted.lower()) else data[: len(wanted)]
    return value


def specified_in(exchanges: Sequence[Exchange]) -> set[str]:
    """Return the releases whose answers are specified; none in a conversation that was recorded."""
    others = {name for exchange in exchanges for name in exchange.get("answers of", ())}
    return others and others | {JULY_2025.name}


def compare_conversation(path: Path, firmware: Firmware, on_progress: Callable[[int, int], None]) -> Comparison:
    """Repeat a conversation with a vehicle and compare. Raises InputError if it cannot be used."""
    head, exchanges = read_conversation(path)
    conversation = Conversation(head, firmware, specified_in(exchanges))
    differences: list[Difference] = []
    answers = fields = 0
    for done, exchange in enumerate(exchanges, 1):
        wanted, got = conversation.ask(exchange)
        differences += answer_differences(exchange["name"], wanted, got)
        answers += len(wanted)
        fields += sum(len(answer.keys() - TIMES) for _, answer in wanted)
        on_progress(done, len(exchanges))
    return Comparison(path, CONVERSATION, firmware.name, len(exchanges), answers, answers + fields, tuple(differences))
