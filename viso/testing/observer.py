# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Notes the messages, texts, records and outcomes of a vehicle for a test."""

from collections import deque
from collections.abc import Sequence
from typing import Final

from ap_core.log_field import LogValue
from ap_core.log_structure import LogStructure
from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from mav_handlers.endpoint import MessageEvent
from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import Message
from viso.streams.stream import StreamMessage
from viso.testing.observations import MessageVerdict, Record, StatusText
from viso.vehicle.outcomes import OUTCOME_WAIT_US, FilterWatch, HandedSample, SampleOutcomes
from viso.vehicle.sensors.airframe import AirframeState
from viso.vehicle.vehicle import Vehicle

VISION_RECORDS: Final = tuple(structure.name for structure in LOG_STRUCTURE_FROM_VISUALODOM)
"""Names of the records that external navigation makes."""


class Observer:
    """Listens to a vehicle and its filter from now on.

    Attributes:
        verdicts: the outcome of each message.
        status_texts: those that the vehicle sent.
        records: those of the log, whether it is open or not.
        received: the messages that the vehicle has sent.
        sent: the frames that were sent to it, with their times of arrival.
        truths: where a vehicle that flies really was at these times, us since boot.
    """

    def __init__(self, vehicle: Vehicle, watch: FilterWatch) -> None:
        self._vehicle = vehicle
        self._outcomes = SampleOutcomes()
        watch.listeners.append(self._outcomes.take)
        self._decoder = Codec(255, 190)
        self._of_message: list[Record] = []
        self._waiting: deque[tuple[int, Sequence[HandedSample]]] = deque()
        self.verdicts: list[MessageVerdict] = []
        self.status_texts: list[StatusText] = []
        self.records: list[Record] = []
        self.received: list[Message] = []
        self.sent: list[StreamMessage] = []
        self.truths: list[tuple[int, AirframeState]] = []
        vehicle.logger.on_write = self._take_record
        vehicle.endpoint.on_event = self._take_event
        vehicle.texts.on_text.append(self._take_text)

    def clear(self) -> None:
        """Empty all lists; verdicts that a test has kept still get the outcomes of their samples."""
        for noted in (self.verdicts, self.status_texts, self.records, self.received, self.sent, self.truths):
            noted.clear()

    def take_output(self, data: bytes) -> None:
        """Note what the vehicle has sent."""
        self._decoder.feed(data)
        while (received := self._decoder.next_received()) is not None:
            if isinstance(received, Received) and received.message is not None:
                self.received.append(received.message)

    def forget_old_samples(self) -> None:
        """Wait no longer for the outcomes of samples whose turn has passed."""
        now_us = self._vehicle.clock.micros64()
        while self._waiting and self._waiting[0][0] <= now_us:
            self._outcomes.forget(self._waiting.popleft()[1])

    def _take_record(self, structure: LogStructure, values: Sequence[LogValue]) -> None:
        fields = dict(zip(structure.fields, values, strict=True))
        record = Record(self._vehicle.clock.micros64(), structure.name, fields)
        self.records.append(record)
        if structure.name in VISION_RECORDS:
            self._of_message.append(record)

    def _take_text(self, severity: int, text: str) -> None:
        self.status_texts.append(StatusText(self._vehicle.clock.micros64(), severity, text))

    def _take_event(self, event: MessageEvent) -> None:
        header, rule = event.header, event.verdict.rule
        if header is not None:
            self.sent.append(StreamMessage(event.now_us, header.frame))
            if self._vehicle.source.airframe is not None:
                self.truths.append((event.now_us, self._vehicle.source.airframe.state))
        samples = self._outcomes.take_handed()
        verdict = MessageVerdict(
            event.now_us,
            event.name,
            None if header is None else header.system_id,
            None if header is None else header.component_id,
            event.message,
            event.verdict.kind,
            rule.code,
            rule.text,
            rule.source,
            tuple(self._of_message),
            samples,
        )
        self._of_message.clear()
        self.verdicts.append(verdict)
        if samples:
            self._waiting.append((event.now_us + OUTCOME_WAIT_US, samples))
