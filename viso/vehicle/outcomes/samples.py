# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Finds out which message a sample in the filter came with, when its fate is told a tenth of a second later."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from viso.vehicle.outcomes.labels import Fate, as_dict, fate_of, is_final
from viso.vehicle.outcomes.watch import SampleTest

FATE_WAIT_US: Final = 500_000
"""How long a message waits for the fates of its samples in the filter; that takes some 60 to 250 ms."""


@dataclass(eq=False, slots=True)
class HandedSample:
    """A sample that a message handed to the filter, and its outcome so far.

    A pose has two fates where height comes from it as well: ``pose``, of its north and east, and ``height``.
    """

    kind: str
    observed_ms: int
    fates: list[SampleTest] = field(default_factory=list)

    @property
    def is_settled(self) -> bool:
        """Return whether the filter has decided about it."""
        return any(fate.outcome.kind == self.kind for fate in self.fates)

    def fates_as_dicts(self) -> list[dict[str, object]]:
        """Return its fates for machines, each with its time in us since boot."""
        return [{"time_us": fate.time_us, **as_dict(fate.outcome)} for fate in self.fates]


class SampleFates:
    """Brings samples and their fates together; a listener of ``FilterWatch``.

    Samples leave the filter in the order in which they came, so those of one kind and time are told apart by that.
    """

    def __init__(self) -> None:
        self._handed: list[HandedSample] = []
        self._waiting: defaultdict[tuple[str, int], list[HandedSample]] = defaultdict(list)

    def take(self, test: SampleTest) -> None:
        """Take what the filter tells."""
        kind, rule, observed_ms, *_ = test.outcome
        if not is_final(rule):
            sample = HandedSample(kind, observed_ms)
            self._handed.append(sample)
            self._waiting[kind, observed_ms].append(sample)
        elif fate_of(rule) is Fate.REFUSED:
            self._handed.append(HandedSample(kind, observed_ms, [test]))
        elif kind == "height":
            # Of several poses of one time only the last is used.
            for sample in self._waiting.get(("pose", observed_ms), [])[-1:]:
                sample.fates.append(test)
        else:
            for sample in self._waiting.get((kind, observed_ms), ()):
                if not sample.is_settled:
                    sample.fates.append(test)
                    break

    def take_handed(self) -> tuple[HandedSample, ...]:
        """Return, once, the samples handed in since the last call: those of the message just handled."""
        handed, self._handed = tuple(self._handed), []
        return handed

    def forget(self, samples: Iterable[HandedSample]) -> None:
        """Wait no longer for the fates of samples."""
        for sample in samples:
            waiting = self._waiting.get((sample.kind, sample.observed_ms), [])
            if sample in waiting:
                waiting.remove(sample)
            if not waiting:
                self._waiting.pop((sample.kind, sample.observed_ms), None)
