# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Values in single fields: raw integers, scaled floats, float bits, text."""

import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.log_field import FORMATS, LogValue

INTEGER_WIDTHS = {"b": 8, "h": 16, "i": 32, "q": 64, "B": 8, "M": 8, "H": 16, "I": 32, "Q": 64}
INTEGER_WIDTHS |= {"c": 16, "C": 16, "e": 32, "E": 32, "L": 32}
numbers = st.one_of(st.integers(), st.floats(), st.floats(width=32).map(np.float32), st.floats().map(np.float64))


def field(char: str, value: LogValue) -> bytes:
    code, convert = FORMATS[char]
    return struct.pack("<" + code, convert(value))


def signed(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=True)


@pytest.mark.parametrize("char", INTEGER_WIDTHS)
@given(value=st.integers())
def test_integers_are_raw_and_wrap(char: str, value: int) -> None:
    stored = int.from_bytes(field(char, value), "little")
    assert stored == value % (1 << INTEGER_WIDTHS[char])


@pytest.mark.parametrize("char", [char for char in FORMATS if char not in "anNZ"])
@given(value=numbers)
def test_no_number_makes_a_numeric_field_raise(char: str, value: LogValue) -> None:
    assert len(field(char, value)) == struct.calcsize("<" + FORMATS[char][0])


@pytest.mark.parametrize("char", "cCeE")
@pytest.mark.parametrize(("value", "stored"), [(1.239, 123), (0.0, 0), (0.009, 0)])
def test_centi_fields_multiply_floats_and_truncate(char: str, value: float, stored: int) -> None:
    assert signed(field(char, value)) == stored


@pytest.mark.parametrize("char", "ce")
def test_centi_fields_truncate_negative_floats_towards_zero(char: str) -> None:
    assert signed(field(char, -1.239)) == -123


def test_centi_field_rounds_the_product_of_a_float32_to_float32() -> None:
    # 0.29 as float32 is below 0.29; its exact product with 100 is below 29, the float32 product is 29.
    assert signed(field("c", np.float32(0.29))) == 29


def test_centi_field_wraps_values_out_of_range() -> None:
    assert signed(field("c", 400.0)) == 40000 - 65536


def test_unsigned_centi_field_wraps_negative_values() -> None:
    assert field("C", -1.0) == struct.pack("<H", 65536 - 100)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e30, np.float32(3e38)])
@pytest.mark.parametrize(("char", "stored"), [("c", 0), ("C", 0), ("e", 1 << 31), ("E", 0), ("Q", 1 << 63)])
def test_floats_that_no_register_holds_convert_as_on_x86_64(char: str, stored: int, value: float) -> None:
    assert int.from_bytes(field(char, value), "little") == stored


def test_unsigned_32_bit_field_keeps_floats_above_the_signed_range() -> None:
    assert field("I", 3e9) == struct.pack("<I", 3_000_000_000)


def test_location_field_takes_integers_as_degrees_times_1e7() -> None:
    assert field("L", -353632621) == struct.pack("<i", -353632621)


def test_location_field_takes_floats_as_degrees() -> None:
    assert signed(field("L", -35.5)) == -355_000_000


@given(bits=st.integers(0, 0xFFFFFFFF))
def test_float32_keeps_every_bit(bits: int) -> None:
    assert field("f", np.uint32(bits).view(np.float32)) == struct.pack("<I", bits)


def test_float32_keeps_a_signalling_nan() -> None:
    assert field("f", np.uint32(0x7F812345).view(np.float32)).hex() == "4523817f"


@given(value=st.floats())
def test_double_keeps_every_value(value: float) -> None:
    assert field("d", np.float64(value)) == struct.pack("<d", value)


def test_float_is_rounded_to_float32_once() -> None:
    assert field("f", 0.1) == np.float32(0.1).tobytes()


@pytest.mark.parametrize(
    ("value", "stored"), [(1e300, math.inf), (-1e300, -math.inf), (10**400, math.inf)], ids=["high", "low", "int"]
)
@pytest.mark.parametrize(("char", "code"), [("g", "e"), ("f", "f")])
def test_float_overflow_gives_infinity(char: str, code: str, value: float, stored: float) -> None:
    assert struct.unpack("<" + code, field(char, value)) == (stored,)


@pytest.mark.parametrize(("char", "size"), [("n", 4), ("N", 16), ("Z", 64)])
def test_text_is_padded_with_nul(char: str, size: int) -> None:
    assert field(char, "ab") == b"ab" + bytes(size - 2)


@pytest.mark.parametrize(("char", "size"), [("n", 4), ("N", 16), ("Z", 64)])
def test_text_that_fills_its_field_has_no_terminator(char: str, size: int) -> None:
    assert field(char, "x" * 100) == b"x" * size


def test_text_ends_at_its_first_nul() -> None:
    assert field("n", "a\0b") == b"a\0\0\0"


def test_bytes_keep_what_follows_a_nul() -> None:
    assert field("n", b"a\0b") == b"a\0b\0"


@given(value=st.one_of(st.text(), st.binary()))
def test_no_text_makes_a_text_field_raise(value: str | bytes) -> None:
    assert len(field("N", value)) == 16


@pytest.mark.parametrize("char", "BfdcL")
@pytest.mark.parametrize("value", ["1", b"1"])
def test_numeric_fields_refuse_text(char: str, value: str | bytes) -> None:
    with pytest.raises(TypeError, match="text in a numeric field"):
        field(char, value)


def test_text_fields_refuse_numbers() -> None:
    with pytest.raises(TypeError, match="a number in a text field"):
        field("Z", 1)
