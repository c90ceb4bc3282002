# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A made-up autopilot that answers a recorder as it is told to, and what moves the time of both."""

import gzip
import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import (
    AUTOPILOT_VERSION,
    COMMAND_ACK,
    COMMAND_LONG,
    HEARTBEAT,
    LOG_DATA,
    LOG_ENTRY,
    LOG_REQUEST_DATA,
    LOG_REQUEST_LIST,
    PARAM_REQUEST_LIST,
    PARAM_REQUEST_READ,
    PARAM_SET,
    PARAM_VALUE,
    TIMESYNC,
    Message,
)
from viso.recording.recorder import Recorder, Recording
from viso.recording.scenario import parse_scenario

STEP_US = 50_000
VERSION = AUTOPILOT_VERSION(0, 4 << 24 | 7 << 16, 0, 0, 0, tuple(b"2b361bde"), (0,) * 8, (0,) * 8, 0, 0, 0)
REBOOT, REQUEST_MESSAGE, ARM = 246, 512, 400


class FakeAutopilot:
    """Answers; what it is asked is kept.

    Attributes:
        params: by name.
        fixed: names of parameters that it refuses to change.
        is_armed: whether its heartbeat says so.
        is_dead: whether it is silent.
        reboots: whether it does when it is asked to.
        log: its only log.
        lost: offsets of the log that are lost the first time.
        asked: messages in the order received.
        on_message: called with each before it is answered.
    """

    def __init__(self) -> None:
        self.params = {"VISO_TYPE": 0.0, "VISO_SCALE": 1.0, "EK3_SRC1_YAW": 1.0}
        self.fixed: set[str] = set()
        self.is_armed = self.is_dead = False
        self.reboots = True
        self.log = bytes(range(200)) * 2
        self.lost: set[int] = set()
        self.asked: list[Message] = []
        self.on_message: Callable[[Message], None] = lambda _message: None
        self.booted_us = -3_000_000
        self.now_us = 0
        self.answers: list[Message] = []
        self._codec = Codec(1, 1)
        self._next_beat_us = 0

    def run(self, now_us: int, data: bytes) -> bytes:
        """Take in bytes and return the answers."""
        self.now_us = now_us
        if self.is_dead:
            return b""
        if now_us >= self._next_beat_us:
            self._next_beat_us = now_us + 1_000_000
            self.answers.append(HEARTBEAT(2, 3, 0x80 if self.is_armed else 0, 0, 4, 3))
        self._codec.feed(data)
        while (received := self._codec.next_received()) is not None:
            assert isinstance(received, Received)
            assert received.message is not None
            self.asked.append(received.message)
            self.on_message(received.message)
            self._answer(received.message)
        told, self.answers = self.answers, []
        return b"".join(map(self._codec.encode, told))

    def _answer(self, message: Message) -> None:
        names = list(self.params)
        match message:
            case TIMESYNC(tc1=0):
                self.answers.append(replace(message, tc1=(self.now_us - self.booted_us) * 1000))
            case PARAM_REQUEST_LIST():
                self.answers += map(self._value, names)
            case PARAM_REQUEST_READ():
                name = message.param_id or names[message.param_index]
                self.answers += [self._value(name)] if name in self.params else []
            case PARAM_SET():
                if message.param_id not in self.fixed:
                    self.params[message.param_id] = message.param_value
                self.answers.append(self._value(message.param_id))
            case COMMAND_LONG():
                self._obey(message)
            case LOG_REQUEST_LIST():
                self.answers.append(LOG_ENTRY(1, 1, 1, 0, len(self.log)) if self.log else LOG_ENTRY(0, 0, 0, 0, 0))
            case LOG_REQUEST_DATA():
                self._send_log(message)

    def _obey(self, message: COMMAND_LONG) -> None:
        refused = message.command == ARM or (message.command == REBOOT and not self.reboots)
        self.answers.append(COMMAND_ACK(message.command, 4 if refused else 0))
        if message.command == REBOOT and self.reboots:
            self.booted_us = self.now_us
        elif message.command == REQUEST_MESSAGE:
            self.answers.append(VERSION)

    def _value(self, name: str) -> PARAM_VALUE:
        names = list(self.params)
        return PARAM_VALUE(name, self.params[name], 9, len(names), names.index(name))

    def _send_log(self, request: LOG_REQUEST_DATA) -> None:
        end = min(len(self.log), request.ofs + request.count)
        for offset in range(request.ofs, end, 90):
            data = self.log[offset : min(end, offset + 90)]
            if offset in self.lost:
                self.lost.remove(offset)
            else:
                self.answers.append(LOG_DATA(1, offset, len(data), tuple(data.ljust(90, b"\0"))))


def drive(recorder: Recorder, autopilot: FakeAutopilot, until_us: int = 600_000_000) -> Recording:
    """Let both run, in steps of their time, until the recorder is over."""
    for now_us in range(0, until_us, STEP_US):
        data = recorder.advance(now_us)
        answers = autopilot.run(now_us, data)
        if recorder.is_over:
            return recorder.recording
        recorder.receive(now_us, answers)
    raise AssertionError("the recorder does not end")


def recorder_of(steps: str, *, more: str = "", allow_armed: bool = False) -> Recorder:
    """Return a recorder of a scenario that sets one parameter; its steps and other fields are YAML."""
    text = f"name: made_up\nabout: x\nparameters: {{VISO_TYPE: 1}}\n{more}\nsteps:\n{steps}"
    return Recorder(parse_scenario(text, "made_up.yaml"), allow_armed=allow_armed)


def float32(value: float) -> float:
    """Return a number as the wire has it."""
    found: float = struct.unpack("<f", struct.pack("<f", value))[0]
    return found


def read_lines(path: Path) -> list[dict[str, Any]]:
    """Return the lines of a recorded capture."""
    with gzip.open(path, "rt", encoding="utf-8") as file:
        return [json.loads(line) for line in file]
