# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversations with the autopilot: what each release answers to whatever a client may ask."""

from functools import cache

import pytest

from tests.places import DATA
from viso.compare.conversations import Conversation, Exchange, answer_differences, read_conversation, specified_in
from viso.firmware.releases import FEBRUARY_2026, JULY_2025, PROFILES, STABLE_4_6

CONVERSATIONS = DATA / "conversations"
NAMES = ("parked", "camera", "zero_origin")


@cache
def read(name: str) -> tuple[Exchange, list[Exchange]]:
    return read_conversation(CONVERSATIONS / f"{name}.jsonl")


def differences(conversation: Conversation, exchange: Exchange) -> list[str]:
    """Return how the answers of an exchange differ from those that it wants."""
    found = answer_differences(exchange["name"], *conversation.ask(exchange))
    return [f"{one} ({exchange['why']})" for one in found]


# The simulator of 4.6.3 was asked what 4.6 answers otherwise. The usual run has the reference's answers of the long
# conversation, and other releases' of the others.
USUAL = {("parked", JULY_2025.name), ("camera", FEBRUARY_2026.name), ("zero_origin", STABLE_4_6.name)}
CASES = [
    pytest.param(name, firmware, marks=() if (name, firmware) in USUAL else pytest.mark.slow)
    for name in NAMES
    for firmware in PROFILES
]


@pytest.mark.parametrize(("name", "firmware"), CASES)
def test_every_release_answers_as_it_is_specified(name: str, firmware: str) -> None:
    head, exchanges = read(name)
    conversation = Conversation(head, PROFILES[firmware], specified_in(exchanges))
    assert [one for exchange in exchanges for one in differences(conversation, exchange)] == []


def test_conversations_are_long_and_each_exchange_has_its_reason() -> None:
    exchanges = [exchange for name in NAMES for exchange in read(name)[1]]
    assert len(exchanges) > 220
    assert all(exchange["why"] for exchange in exchanges)
    assert len({exchange["name"] for exchange in exchanges}) > 210


def test_releases_are_told_apart() -> None:
    exchanges = [exchange for name in NAMES for exchange in read(name)[1]]
    different = [exchange.get("answers of", {}) for exchange in exchanges]
    assert sum("2026-02" in answers for answers in different) > 25
    assert sum("4.6" in answers for answers in different) > 15


def test_answers_of_another_release_are_not_taken() -> None:
    head, exchanges = read("parked")
    conversation = Conversation(head, JULY_2025)
    of_later = [
        {**exchange, "answers": exchange["answers of"]["2026-02"], "answers of": {}}
        for exchange in exchanges[:45]
        if "2026-02" in exchange.get("answers of", {})
    ]
    assert len(of_later) > 10
    assert all(differences(conversation, exchange) for exchange in of_later)
