# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of things that functions work on."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from librt.vecs import vec

from mav_handlers.verdicts import HANDLED
from tests.copies import Copies


@dataclass
class Counter:
    """Counts by a function that it made itself."""

    count: int = 0
    verdict: object = HANDLED
    listeners: list[Callable[[], None]] = field(default_factory=list)

    def __post_init__(self) -> None:
        step = 1

        def up() -> None:
            self.count += step

        self.listeners.append(up)
        self.listeners.append(self.double)

    def double(self) -> None:
        self.count *= 2

    def run(self) -> int:
        for listener in self.listeners:
            listener()
        return self.count


def test_functions_of_a_copy_work_on_the_copy() -> None:
    original = Counter(3)
    copies = Copies(original)
    first, second = copies.make(), copies.make()
    assert first.run() == 8
    assert first.run() == 18
    assert (original.count, second.count) == (3, 3)
    assert original.run() == second.run() == 8


def test_copies_stay_as_the_original_was() -> None:
    original = Counter(3)
    copies = Copies(original)
    original.run()
    assert copies.make().count == 3


def test_what_one_part_shares_with_another_it_shares_in_the_copy() -> None:
    shared = [1]
    first, second = Copies((shared, shared)).make()
    first.append(2)
    assert second == [1, 2]
    assert shared == [1]


def test_constants_of_modules_keep_their_identity() -> None:
    assert Copies(Counter()).make().verdict is HANDLED


def test_what_cannot_be_copied_is_refused(tmp_path: Path) -> None:
    with (tmp_path / "file").open("w") as file, pytest.raises(TypeError):
        Copies([file])


class LikeCompiled:
    """Has its attributes where a class has them that mypyc compiles: named by the class, and nowhere else."""

    __slots__ = __mypyc_attrs__ = ("floats", "itself", "unset")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, floats: list[float]) -> None:
        self.floats = vec[float](floats)
        self.itself = self

    def __getstate__(self) -> None:
        raise TypeError("there is nothing that pickle could ask for")


def test_compiled_object_is_copied_by_its_attributes() -> None:
    original = LikeCompiled([1.0, 2.0])
    copies = Copies(original)
    original.floats[0] = 3.0
    copied = copies.make()
    assert list(copied.floats) == [1.0, 2.0]
    assert copied.itself is copied
    assert not hasattr(copied, "unset")
