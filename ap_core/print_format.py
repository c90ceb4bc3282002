# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers in texts, as the firmware prints them.

FIRMWARE PARITY: a number below 1 is rounded to one digit more than its text has, and then cut off: 0.98 is printed as
0.9 with one decimal. A text ends after seven digits.

Source: AP_HAL/utility/ftoa_engine.cpp, AP_HAL/utility/print_vprintf.cpp.
"""

import math
import struct
from typing import Final, NamedTuple

_MOST_DIGITS: Final = 7
_MOST_SHOWN: Final = 8
_PLACES: Final = 15
"""The decimal places of the integer that the mantissa is scaled to."""
_MANTISSA_BITS: Final = 23
_EXPONENT_BIAS: Final = 127
_LARGEST_POWER: Final = 40  # of ten, beyond a float's
_LARGEST: Final = 9999999.0
"""A number beyond is printed with an exponent."""


def _scale(index: int) -> tuple[int, int]:
    """Return the factor of mantissas whose exponent is 8 times the index to 7 more, and the power of ten left over."""
    twos, power = 8 * index + 7 - _EXPONENT_BIAS - _MANTISSA_BITS + 8, -_LARGEST_POWER
    above, below = 10 ** (_PLACES - 1 - power) * 2 ** max(twos, 0), 2 ** max(-twos, 0)
    while above >= below << 32:
        below, power = 10 * below, power + 1
    return (2 * above + below) // (2 * below), power


_SCALES: Final = [_scale(index) for index in range(32)]


class _Decimal(NamedTuple):
    """Significant digits, the power of ten of the first, and whether rounding made it 1 from 9."""

    digits: str
    power: int
    is_carried: bool


def _decimal(value: float, most_digits: int, most_decimals: int) -> _Decimal:
    """Return a float32 above zero in decimal; ``most_decimals`` includes the digit before the point, 0 for no limit."""
    (bits,) = struct.unpack("<I", struct.pack("<f", value))
    exponent, mantissa = bits >> _MANTISSA_BITS & 0xFF, bits & 0x7FFFFF
    mantissa, exponent = (mantissa | 1 << _MANTISSA_BITS, exponent) if exponent else (mantissa, 1)
    factor, power = _SCALES[exponent >> 3]
    text = str(mantissa * factor >> 15 - (exponent & 7)).zfill(_PLACES)
    first = _PLACES - len(text.lstrip("0"))
    power -= first
    count = min(most_digits, most_decimals + max(power + 1, 1) - 1) if most_decimals else most_digits + 1
    digits, rest = text[first : first + count], text[first + count :]
    if int(rest or "0") >= 10 ** len(rest) // 2:
        rounded = str(int(digits) + 1)
        if len(rounded) > len(digits):
            return _Decimal(rounded[:-1], power + 1, True)
        digits = rounded
    return _Decimal(digits, power, False)


def fixed(value: float, decimals: int, width: int = 0) -> str:
    """Return a number with some decimals, at least ``width`` characters long, as ``%4.1f`` does."""
    sign = "-" if math.copysign(1.0, value) < 0 and not math.isnan(value) else ""
    if not math.isfinite(value):
        return f"{sign}{'nan' if math.isnan(value) else 'inf'}".rjust(width)
    size = struct.unpack("<f", struct.pack("<f", abs(value)))[0]
    if size > _LARGEST:
        return f"{sign}{_with_exponent(size, decimals)}".rjust(width)
    decimal = _decimal(size, _MOST_DIGITS, decimals + 1) if size else _Decimal("0" * (_MOST_DIGITS + 1), 0, False)
    return f"{sign}{_shown(decimal, decimals)}".rjust(width)


def _shown(decimal: _Decimal, decimals: int) -> str:
    digits, power, is_carried = decimal
    known = decimals + 1 + power - (is_carried and digits[0] == "1")
    known = min(max(known, 1), _MOST_SHOWN)
    text = ""
    for place in range(max(power, 0), -decimals - 1, -1):
        at = power - place
        if len(digits) <= at < known:
            return text
        text += "." * (place == -1) + (digits[at] if 0 <= at < known else "0")
    # The last digit is 0 where the first one that counts is the next: that rounds.
    if power == -decimals - 1 and (digits[0] > "5" or (digits[0] == "5" and not is_carried)):
        text = text[:-1] + "1"
    return text


def _with_exponent(size: float, decimals: int) -> str:
    decimal = _decimal(size, min(decimals, _MOST_DIGITS), 0)
    digits = decimal.digits.ljust(decimals + 1, "0")
    return f"{digits[0]}{'.' * (decimals > 0)}{digits[1 : decimals + 1]}e+{decimal.power:02}"
