# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The result of a comparison: how much was compared, and what differs."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from viso.compare.differences import Difference


@dataclass(frozen=True)
class Comparison:
    """The comparison of a recording with viso.

    Attributes:
        kind: the kind of recording.
        firmware: the name of the profile that viso had.
        messages: the number of messages, calls, exchanges or frames that were played.
        records: the number of records, outputs or answers that they made.
        fields: the number of fields, texts and acknowledgements that were compared.
        notes: what could not be compared, a line each.
        named: the name of the profile that the recording names; empty if it names none.
        firmware_reason: why viso had that profile, as the end of a sentence.
    """

    path: Path
    kind: str
    firmware: str
    messages: int
    records: int
    fields: int
    differences: tuple[Difference, ...]
    notes: tuple[str, ...] = ()
    named: str = ""
    firmware_reason: str = ""

    @property
    def judged_as(self) -> str:
        """Which profile viso had, and why."""
        return f"judged as {self.firmware}: {self.firmware_reason}"

    @property
    def passed(self) -> bool:
        """Whether nothing differs."""
        return not self.differences

    @cached_property
    def by_field(self) -> Mapping[str, tuple[int, Difference]]:
        """The number of differences of each field, and the first of them."""
        counts = Counter(difference.field for difference in self.differences)
        first = {difference.field: difference for difference in reversed(self.differences)}
        return {field: (count, first[field]) for field, count in counts.items()}

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison for machines."""
        fields = [
            {
                "field": field,
                "differences": count,
                "first": {"place": first.place, "recorded": first.recorded, "ours": first.ours, "unit": first.unit},
            }
            for field, (count, first) in self.by_field.items()
        ]
        return {
            "recording": str(self.path),
            "kind": self.kind,
            "firmware": self.firmware,
            "firmware_reason": self.firmware_reason,
            "named": self.named or None,
            "messages": self.messages,
            "records": self.records,
            "fields": self.fields,
            "differences": len(self.differences),
            "passed": self.passed,
            "fields_that_differ": fields,
            "notes": list(self.notes),
        }
