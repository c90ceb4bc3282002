# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A message of the stream, and what the autopilot made of it."""

from dataclasses import dataclass

from ap_core.log_field import LogValue
from ap_core.verdict import Outcome, Verdict
from mav_handlers.wire.messages import Message
from viso.fates.samples import HandedSample


@dataclass(frozen=True, slots=True)
class SeenMessage:
    """A message, or bytes that are none.

    Attributes:
        number: in the stream, from 1.
        arrival_us: when the autopilot handled it, us since boot.
        system_id, component_id, sequence: of its header; 0 of bytes that are no frame.
        version: of MAVLink; 0 of bytes that are no frame.
        name: MAVLink's name of it; BAD_DATA of bytes that are no frame.
        message: what it says, if its type is one of ours.
        frame: its bytes; empty of bytes that are no frame.
        verdict: what the autopilot made of it.
        records: the VISO, VISP and VISV records that it made.
        samples: those that it handed to the filter, with their fates.
    """

    number: int
    arrival_us: int
    system_id: int
    component_id: int
    sequence: int
    version: int
    name: str
    message: Message | None
    frame: bytes
    verdict: Verdict
    records: tuple[tuple[str, tuple[LogValue, ...]], ...]
    samples: tuple[HandedSample, ...]

    @property
    def sender(self) -> tuple[int, int]:
        """System and component."""
        return self.system_id, self.component_id

    @property
    def is_taken(self) -> bool:
        """Whether it got as far as the backend, so that it counts for health."""
        return self.verdict.outcome in (Outcome.ACCEPTED, Outcome.IGNORED)
