# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Turns what a test sends into frames: the project's messages, pymavlink's, or bytes."""

import dataclasses
from typing import Any

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import MESSAGES, Message

__tracebackhide__ = True  # what goes wrong for a test's own fault is shown where the test is


class Sender:
    """Frames of any number of senders, each with a count of its own."""

    def __init__(self) -> None:
        self._codecs: dict[tuple[int, int], Codec] = {}

    def frame(self, message: object, system_id: int, component_id: int) -> bytes:
        """Return a frame with a message of the project's or of pymavlink's, MAVLink 2, or bytes as they are.

        The ids, 1..255, are of the sender; a header that pymavlink's message may have plays no part.

        Raises:
            TypeError: it is none of these.
            ValueError: an id is out of range, a field does not fit its type, or nobody here knows the message.
        """
        if isinstance(message, (bytes, bytearray, memoryview)):
            return bytes(message)
        for name, number in (("system_id", system_id), ("component_id", component_id)):
            if not 1 <= number <= 255:
                raise ValueError(f"{name} {number}: not between 1 and 255")
        typed = message if isinstance(message, Message) else _typed(message)
        codec = self._codecs.setdefault((system_id, component_id), Codec(system_id, component_id))
        try:
            return codec.encode(typed)
        except Exception as error:  # struct.error, TypeError and others, as pymavlink happens to raise
            raise ValueError(f"{typed}: a field does not fit its type: {error}") from error


def _typed(message: Any) -> Message:
    """Return one of pymavlink's messages as one of the project's."""
    if not (hasattr(message, "get_type") and hasattr(message, "get_fieldnames")):
        what = type(message).__name__
        raise TypeError(f"send takes a message of mav_handlers.wire.messages, one of pymavlink's or bytes, not {what}")
    name = message.get_type()
    cls = MESSAGES.get(name)
    if cls is None:
        raise ValueError(f"{name}: the emulator knows the name alone; send its bytes: message.pack(mav)")
    # An older dialect may lack a field that was added later, which is then as if it were not sent.
    known = {field.name for field in dataclasses.fields(cls)}
    return cls(**{field: _plain(getattr(message, field)) for field in message.get_fieldnames() if field in known})


def _plain(value: Any) -> Any:
    if isinstance(value, bytes):
        return value.partition(b"\0")[0].decode("ascii", "replace")
    return tuple(value) if isinstance(value, (list, tuple)) else value
