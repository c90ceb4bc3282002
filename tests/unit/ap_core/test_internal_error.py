# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Internal errors are collected until reboot."""

from ap_core.internal_error import InternalError, InternalErrors


def test_bits_are_the_firmwares() -> None:
    assert (int(InternalError.CONSTRAINING_NAN), int(InternalError.BAD_ROTATION)) == (0x400, 0x400000)


def test_nothing_is_collected_at_first() -> None:
    errors = InternalErrors()
    assert (errors.mask, errors.count, errors.last) == (0, 0, None)


def test_mask_accumulates() -> None:
    errors = InternalErrors()
    errors(InternalError.BAD_ROTATION)
    errors(InternalError.CONSTRAINING_NAN)
    assert errors.mask == 0x400400


def test_repeated_error_is_counted_again() -> None:
    errors = InternalErrors()
    errors(InternalError.BAD_ROTATION)
    errors(InternalError.BAD_ROTATION)
    assert (errors.mask, errors.count) == (0x400000, 2)


def test_last_error_is_remembered() -> None:
    errors = InternalErrors()
    errors(InternalError.CONSTRAINING_NAN)
    errors(InternalError.BAD_ROTATION)
    assert errors.last is InternalError.BAD_ROTATION
