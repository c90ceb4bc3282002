# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Telemetry taken apart, and telemetry that is damaged."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.companion.sources.gopro_maker import camera, item, nested, numbers, sensor, stream
from viso.companion.sources.gpmf import GpmfError, Stream, items_of, streams_of


def only(payload: bytes) -> Stream:
    (found,) = streams_of(payload)
    return found


def test_stream_is_scaled_and_knows_its_count_time_and_axes() -> None:
    found = only(camera(sensor("ACCL", [(418, -836, 0)], 418, total=7, tick_ms=151_759, axes="YxZ")))
    assert (found.key, found.total, found.axes) == ("ACCL", 7, "YxZ")
    assert found.tick_s == pytest.approx(151.759)
    np.testing.assert_allclose(found.rows, [[1.0, -2.0, 0.0]])


def test_what_is_not_told_is_unknown() -> None:
    found = only(camera(stream(numbers("GYRO", "s", "hhh", (1, 2, 3)))))
    assert (found.total, found.tick_s, found.axes) == (None, None, "")
    np.testing.assert_array_equal(found.rows, [[1, 2, 3]])


def test_time_may_be_in_microseconds() -> None:
    found = only(camera(stream(numbers("ACCL", "s", "hhh", (1, 2, 3)), stmp=numbers("STMP", "J", "Q", [1_500_000]))))
    assert found.tick_s == 1.5


def test_scale_may_differ_from_column_to_column() -> None:
    scale = numbers("SCAL", "l", "i", [1], [10], [100])
    np.testing.assert_array_equal(
        only(camera(stream(numbers("SIMU", "s", "hhh", (5, 50, 500)), scal=scale))).rows, [[5, 5, 5]]
    )


def test_rows_may_be_of_several_types() -> None:
    kinds = item("TYPE", "c", 1, b"Lf[2]B")
    scale = numbers("SCAL", "l", "i", [1000], [1], [1], [1])
    found = only(camera(stream(numbers("ATTD", "?", "IffB", (2500, 0.5, -0.5, 9)), type=kinds, scal=scale)))
    np.testing.assert_allclose(found.rows, [[2.5, 0.5, -0.5, 9.0]])


def test_columns_that_are_no_numbers_are_passed_over() -> None:
    kinds, scale = item("TYPE", "c", 1, b"FS"), numbers("SCAL", "l", "i", [1], [4])
    values = item("FACE", "?", 6, b"ABCD\x00\x08")
    np.testing.assert_array_equal(only(camera(stream(values, type=kinds, scal=scale))).rows, [[2.0]])


@pytest.mark.parametrize(
    ("kind", "form", "raw", "value"),
    [("b", "b", -1, -1), ("B", "B", 255, 255), ("S", "H", 65535, 65535), ("d", "d", 0.1, 0.1),
     ("j", "q", -5, -5), ("q", "i", 3 << 15, 1.5), ("Q", "q", 3 << 31, 1.5)],
)  # fmt: skip
def test_every_type_of_number_is_known(kind: str, form: str, raw: float, value: float) -> None:
    assert only(camera(stream(numbers("DATA", kind, form, [raw])))).rows[0, 0] == value


def test_stream_without_rows_is_empty() -> None:
    assert only(camera(stream(item("ATTD", "?", 29, b""), type=item("TYPE", "c", 1, b"LffffffB")))).rows.shape == (0, 8)


@pytest.mark.parametrize(
    ("payload", "complaint"),
    [
        (camera()[:-4], "of 28 bytes where there are 24"),
        (camera(stream(numbers("DATA", "z", "h", [1]))), "unknown type 'z'"),
        (camera(stream(numbers("DATA", "L", "h", [1]))), "DATA: rows of 2 bytes, their type has 4"),
        (camera(stream(numbers("DATA", "?", "h", [1]))), "DATA: rows of 2 bytes, their type has 0"),
        (camera(sensor("DATA", [(1, 2, 3)], 0)), "DATA: 1 scales for 3 columns, or one of 0"),
        (camera(stream(numbers("DATA", "s", "hhh", (1, 2, 3)), tsmp=item("TSMP", "L", 4, b""))), "TSMP: no number"),
    ],
)
def test_damage_is_told(payload: bytes, complaint: str) -> None:
    with pytest.raises(GpmfError, match=complaint):
        list(streams_of(payload))


def test_items_within_items_are_found() -> None:
    outer = next(items_of(memoryview(nested("DEVC", item("DVNM", "c", 1, b"abc")))))
    assert [(one.key, bytes(one.data)) for one in items_of(outer.data)] == [("DVNM", b"abc")]


SOUND = camera(sensor("ACCL", [(1, 2, 3)] * 4, 100, total=4, tick_ms=99, axes="ZXY")) + camera(
    stream(numbers("ATTD", "?", "If", (1, 0.5)), type=item("TYPE", "c", 1, b"Lf"), scal=numbers("SCAL", "l", "i", [2]))
)


@given(st.lists(st.tuples(st.integers(0, len(SOUND) - 1), st.integers(0, 255)), min_size=1, max_size=5))
def test_whatever_telemetry_holds_nothing_else_is_raised(changes: list[tuple[int, int]]) -> None:
    payload = bytearray(SOUND)
    for position, value in changes:
        payload[position] = value
    try:
        for found in streams_of(bytes(payload)):
            assert found.rows.ndim == 2
    except GpmfError:
        pass
