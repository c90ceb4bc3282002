# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The dataclasses agree with the message definitions that pymavlink was generated from."""

from dataclasses import MISSING, FrozenInstanceError, fields
from typing import Any

import pytest

from mav_handlers.wire.messages import HEARTBEAT, MESSAGES, Message
from tools.make_messages import definition


def fields_of(cls: type[Message]) -> tuple[Any, ...]:
    return fields(cls)


def test_fields_are_those_of_the_definition_in_its_order() -> None:
    ours = {cls.__name__: [field.name for field in fields_of(cls)] for cls in MESSAGES.values()}
    assert ours == {cls.__name__: definition(cls.__name__).fieldnames for cls in MESSAGES.values()}


def test_extension_fields_come_last_and_are_zero_by_default() -> None:
    for cls in MESSAGES.values():
        defaults = [field.default for field in fields_of(cls)]
        extensions = [default for default in defaults if default is not MISSING]
        assert defaults[len(defaults) - len(extensions) :] == extensions, cls
        numbers = [value for default in extensions for value in (default if isinstance(default, tuple) else [default])]
        assert numbers == [0] * len(numbers), cls


def test_default_of_an_array_has_its_length() -> None:
    for cls in MESSAGES.values():
        lengths = dict(
            zip(definition(cls.__name__).ordered_fieldnames, definition(cls.__name__).array_lengths, strict=True)
        )
        arrays = {field.name: len(field.default) for field in fields_of(cls) if isinstance(field.default, tuple)}
        assert arrays == {name: lengths[name] for name in arrays}, cls


def test_messages_cannot_be_changed() -> None:
    message = HEARTBEAT(2, 3, 81, 0, 3, 3)
    with pytest.raises(FrozenInstanceError):
        message.type = 1  # type: ignore[misc]  # the point of the test


def test_messages_with_equal_fields_are_equal() -> None:
    assert HEARTBEAT(2, 3, 81, 0, 3, 3) == HEARTBEAT(2, 3, 81, 0, 3, 3)


def test_no_message_is_a_kind_of_another() -> None:
    for cls in MESSAGES.values():
        assert not [base for base in cls.__mro__[1:] if base.__name__ in MESSAGES], cls
