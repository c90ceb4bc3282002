# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a comparison came to: how much was compared, and each thing that differs."""

import difflib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

ABSENT: Final = "nothing"
"""What stands where one side has something and the other has not."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One thing that differs: ``RECORD.Label``, or a kind of text, at a line, a time since boot or an exchange."""

    place: str
    field: str
    recorded: str
    ours: str
    unit: str = ""

    def __str__(self) -> str:
        unit = self.unit and f" {self.unit}"
        return f"{self.place}: {self.field}: {self.recorded}{unit} is recorded, {self.ours}{unit} of ours"


@dataclass(frozen=True)
class Comparison:
    """How far a recording agrees with viso.

    Attributes:
        firmware: the profile that viso was.
        named: the profile of the release that the recording names; empty where it names none.
        messages: how many messages, calls, exchanges or frames were played.
        records: how many records, outputs or answers they made.
        fields: how many fields, texts and acknowledgements were compared.
        notes: what could not be compared, a line each.
    """

    path: Path
    kind: str
    firmware: str
    named: str
    messages: int
    records: int
    fields: int
    differences: tuple[Difference, ...]
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether nothing differs."""
        return not self.differences

    @cached_property
    def by_field(self) -> Mapping[str, tuple[int, Difference]]:
        """How often each field differs, and the first time it does."""
        counts = Counter(one.field for one in self.differences)
        first = {one.field: one for one in reversed(self.differences)}
        return {field: (count, first[field]) for field, count in counts.items()}

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison for machines."""
        fields = [
            {
                "field": field,
                "differences": count,
                "first": {"place": one.place, "recorded": one.recorded, "ours": one.ours, "unit": one.unit},
            }
            for field, (count, one) in self.by_field.items()
        ]
        return {
            "recording": str(self.path),
            "kind": self.kind,
            "firmware": self.firmware,
            "named": self.named or None,
            "messages": self.messages,
            "records": self.records,
            "fields": self.fields,
            "differences": len(self.differences),
            "passed": self.passed,
            "fields_that_differ": fields,
            "notes": list(self.notes),
        }


def sequence_differences(place: str, field: str, recorded: Sequence[str], ours: Sequence[str]) -> Iterator[Difference]:
    """Yield what differs between two sequences: what is only in one of them, and what stands in place of what."""
    for kind, start, end, our_start, our_end in difflib.SequenceMatcher(
        None, recorded, ours, autojunk=False
    ).get_opcodes():
        if kind != "equal":
            for number in range(max(end - start, our_end - our_start)):
                theirs = recorded[start + number] if start + number < end else ABSENT
                mine = ours[our_start + number] if our_start + number < our_end else ABSENT
                yield Difference(place, field, theirs, mine)
