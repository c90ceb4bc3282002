# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages that the firmware's dialect has already, and pymavlink's releases know as drafts: AVAILABLE_MODES.

pymavlink has them in a second dialect beside the firmware's, as large as that and as slow to import.
"""

import struct
from typing import Any, Final, NamedTuple


class _Field(NamedTuple):
    """A field as it stands on the wire; ``place`` is that in the definition, ``length`` that of an array or 0."""

    name: str
    type: str
    code: str
    place: int
    length: int = 0


# Source: common.xml, AVAILABLE_MODES and AVAILABLE_MODES_MONITOR; fields by size, as they are sent.
_DRAFTS: Final = (
    (
        (435, "AVAILABLE_MODES", 134),
        (
            _Field("custom_mode", "uint32_t", "I", 3),
            _Field("properties", "uint32_t", "I", 4),
            _Field("number_modes", "uint8_t", "B", 0),
            _Field("mode_index", "uint8_t", "B", 1),
            _Field("standard_mode", "uint8_t", "B", 2),
            _Field("mode_name", "char", "c", 5, 35),
        ),
    ),
    ((437, "AVAILABLE_MODES_MONITOR", 30), (_Field("seq", "uint8_t", "B", 0),)),
)


def _class_of(base: Any, msg_id: int, name: str, crc_extra: int, fields: tuple[_Field, ...]) -> Any:
    defined = sorted(fields, key=lambda field: field.place)
    names = [field.name for field in defined]
    texts = [field.name for field in fields if field.length]
    unpacker = struct.Struct("<" + "".join(f"{field.length}s" if field.length else field.code for field in fields))

    def __init__(self: Any, *values: Any, **named: Any) -> None:
        base.__init__(self, msg_id, name)
        self._fieldnames = names
        self._sent = dict(zip(names, values, strict=False)) | named
        vars(self).update(self._sent)
        for text in texts:
            setattr(self, text, self._sent[text].split(b"\0", 1)[0].decode("ascii", errors="replace"))

    def pack(self: Any, mav: Any, force_mavlink1: bool = False) -> Any:
        payload = unpacker.pack(*(self._sent[field.name] for field in fields))
        return self._pack(mav, crc_extra, payload, force_mavlink1=force_mavlink1)

    attributes = {
        "id": msg_id,
        "msgname": name,
        "fieldnames": names,
        "ordered_fieldnames": [field.name for field in fields],
        "fieldtypes": [field.type for field in defined],
        "native_format": bytearray(("<" + "".join(field.code for field in fields)).encode()),
        "orders": [fields.index(field) for field in defined],
        "lengths": [1] * len(fields),
        "array_lengths": [field.length for field in fields],
        "crc_extra": crc_extra,
        "unpacker": unpacker,
    }
    return type(name, (base,), {**attributes, "__init__": __init__, "pack": pack})


def draft_messages(base: Any) -> list[Any]:
    """Return the drafts as classes like those of a dialect, whose base of all messages is given."""
    return [_class_of(base, *what, fields) for what, fields in _DRAFTS]
