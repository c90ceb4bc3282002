# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A reader takes what comes, whatever it is; and a domain that there is not is an error in one line."""

import os
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from viso.dds.graph import MAX_DOMAIN, MOST_AT_ONCE, Reader, check_domain
from viso.errors import InputError


class Queue:
    """What DDS holds for a reader: samples, and errors that stand for those that cannot be read."""

    def __init__(self, *waiting: Any) -> None:
        self._waiting = list(waiting)

    def take(self, _count: int) -> list[Any]:
        found = self._waiting.pop(0) if self._waiting else []
        if isinstance(found, Exception):
            raise found
        return [found] if found else []


def sample(*, valid: bool = True) -> Any:
    return SimpleNamespace(sample_info=SimpleNamespace(valid_data=valid))


@pytest.fixture
def descriptor() -> Iterator[int]:
    made = os.eventfd(1, os.EFD_NONBLOCK)
    yield made
    os.close(made)


def test_what_cannot_be_read_is_counted_and_takes_no_other_with_it(descriptor: int) -> None:
    first, last = sample(), sample()
    reader: Reader[Any] = Reader("/t", Queue(first, UnicodeDecodeError("utf-8", b"\xff", 0, 1, "no"), last), descriptor)
    assert reader.take() == [first, last]
    assert reader.damaged == 1
    assert not reader.wait(0)


def test_end_of_a_publisher_is_no_sample(descriptor: int) -> None:
    reader: Reader[Any] = Reader("/t", Queue(sample(valid=False)), descriptor)
    assert reader.take() == []
    assert reader.damaged == 0


def test_flood_leaves_others_their_turn(descriptor: int) -> None:
    reader: Reader[Any] = Reader("/t", Queue(*[sample() for _ in range(MOST_AT_ONCE + 1)]), descriptor)
    assert len(reader.take()) == MOST_AT_ONCE
    assert reader.wait(0)
    assert len(reader.take()) == 1


@pytest.mark.parametrize("domain", [-1, MAX_DOMAIN + 1])
def test_domain_that_there_is_not_is_an_error(domain: int) -> None:
    with pytest.raises(InputError, match=f"^--dds {domain}: "):
        check_domain(domain, "--dds")
