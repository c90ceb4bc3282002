# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The packed parameter file, byte by byte and as pymavlink reads it."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.mavftp import MAVFTP

from ap_core.param import ParamGroup, ParamInfo, ParamTable, ParamType
from mav_handlers.transfers.param_pck import (
    PackedParam,
    PckQuery,
    build_param_pck,
    estimate_size,
    parse_param_pck,
    parse_param_pck_upload,
    parse_query,
)

Read = list[tuple[str, float, int]]

INTEGER_LIMITS = {ParamType.INT8: 1 << 7, ParamType.INT16: 1 << 15, ParamType.INT32: 1 << 31}


def info(name: str, kind: ParamType, default: float = 0) -> ParamInfo:
    return ParamInfo(name, kind, default, "")


def make_table(*rows: ParamInfo) -> ParamTable:
    return ParamTable([ParamGroup("", rows)])


def decoded(data: bytes) -> tuple[Read, Read | None]:
    """Read a file with pymavlink: values, and defaults if there are any."""
    pdata = MAVFTP.ftp_param_decode(data)
    assert pdata is not None

    def plain(params: list[tuple[bytes, float, int]]) -> Read:
        return [(name.decode(), value, kind) for name, value, kind in params]

    return plain(pdata.params), None if pdata.defaults is None else plain(pdata.defaults)


@pytest.fixture
def table() -> ParamTable:
    """A few parameters of every type, two of them changed."""
    table = make_table(
        info("FORMAT_VERSION", ParamType.INT16, 120),
        info("VISO_TYPE", ParamType.INT8),
        ParamInfo("VISO_POS", ParamType.VECTOR3F, (0.0, 0.5, 1.5), ""),
        info("VISO_SCALE", ParamType.FLOAT, 1.0),
        info("LOG_BITMASK", ParamType.INT32, 180222),
    )
    table.set("VISO_TYPE", 2)
    table.set("LOG_BITMASK", -5)
    return table


def test_bytes_of_a_small_file() -> None:
    table = make_table(info("AB_ONE", ParamType.INT8, -1), info("AB_TWO", ParamType.INT16, 258))
    assert build_param_pck(table, read_size=239) == (
        b"\x1b\x67\x02\x00\x02\x00"  # magic, parameters here, parameters in all
        b"\x01\x50AB_ONE\xff"  # int8, six new characters
        b"\x02\x23TWO\x02\x01"  # int16, three characters shared, three new
    )


def test_bytes_of_a_small_file_with_defaults() -> None:
    table = make_table(info("AB_ONE", ParamType.INT8, -1), info("AB_TWO", ParamType.INT16, 258))
    table.set("AB_TWO", 3)
    assert build_param_pck(table, read_size=239, with_defaults=True) == (
        b"\x1c\x67\x02\x00\x02\x00"
        b"\x01\x50AB_ONE\xff"  # has its default
        b"\x12\x23TWO\x03\x00\x02\x01"  # value, then default
    )


def test_name_that_begins_like_the_previous_one_keeps_one_character() -> None:
    table = make_table(info("ABCD", ParamType.INT8), info("ABC", ParamType.INT8))
    assert build_param_pck(table, read_size=239)[6:] == b"\x01\x30ABCD\0" + b"\x01\x02C\0"


def test_names_of_16_characters_fit() -> None:
    table = make_table(info("A" * 16, ParamType.INT8), info("A" * 15 + "B", ParamType.INT8))
    data = build_param_pck(table, read_size=239)
    assert data[6:] == b"\x01\xf0" + b"A" * 16 + b"\0" + b"\x01\x0fB\0"


def test_pymavlink_reads_values(table: ParamTable) -> None:
    values, defaults = decoded(build_param_pck(table, read_size=80))
    assert values == [
        ("FORMAT_VERSION", 120, 2),
        ("VISO_TYPE", 2, 1),
        ("VISO_POS_X", 0.0, 4),
        ("VISO_POS_Y", 0.5, 4),
        ("VISO_POS_Z", 1.5, 4),
        ("VISO_SCALE", 1.0, 4),
        ("LOG_BITMASK", -5, 3),
    ]
    assert defaults is None


def test_pymavlink_reads_defaults(table: ParamTable) -> None:
    values, defaults = decoded(build_param_pck(table, read_size=80, with_defaults=True))
    assert ("LOG_BITMASK", -5, 3) in values
    assert defaults is not None
    assert ("VISO_TYPE", 0, 1) in defaults
    assert ("LOG_BITMASK", 180222, 3) in defaults
    assert ("VISO_SCALE", 1.0, 4) in defaults


def test_large_integers_keep_all_their_bits() -> None:
    table = make_table(info("BIG", ParamType.INT32))
    table.set("BIG", 0x7FFFFFFD)
    assert decoded(build_param_pck(table, read_size=239))[0] == [("BIG", 0x7FFFFFFD, 3)]


def test_default_of_an_integer_is_truncated() -> None:
    table = make_table(info("I", ParamType.INT16, 3))
    table.apply_defaults({"I": 7.9}, "file")
    table.set("I", 1)
    _, defaults = decoded(build_param_pck(table, read_size=239, with_defaults=True))
    assert defaults == [("I", 7, 2)]


def test_default_of_a_float_is_kept() -> None:
    table = make_table(info("F", ParamType.FLOAT, 0.25))
    table.set("F", 1)
    _, defaults = decoded(build_param_pck(table, read_size=239, with_defaults=True))
    assert defaults == [("F", 0.25, 4)]


def test_part_of_the_list(table: ParamTable) -> None:
    data = build_param_pck(table, read_size=239, start=1, count=2)
    assert struct.unpack_from("<HHH", data) == (0x671B, 2, 7)
    assert [name for name, _, _ in decoded(data)[0]] == ["VISO_TYPE", "VISO_POS_X"]


def test_count_beyond_the_end_gives_what_there_is(table: ParamTable) -> None:
    data = build_param_pck(table, read_size=239, start=5, count=100)
    assert struct.unpack_from("<HHH", data) == (0x671B, 2, 7)
    assert [name for name, _, _ in decoded(data)[0]] == ["VISO_SCALE", "LOG_BITMASK"]


@pytest.mark.parametrize(("start", "read_size"), [(7, 239), (-1, 239), (0, 0)])
def test_impossible_part_is_misuse(table: ParamTable, start: int, read_size: int) -> None:
    with pytest.raises(ValueError, match=r"start is|read size is"):
        build_param_pck(table, read_size=read_size, start=start)


def test_padding_moves_a_value_to_the_next_block() -> None:
    # Header 6, then type, lengths and name 3, value 4: bytes 9 to 12.
    table = make_table(info("F", ParamType.FLOAT, 1.0))
    entry = b"\x04\x00F" + struct.pack("<f", 1.0)
    assert build_param_pck(table, read_size=13)[6:] == entry
    assert build_param_pck(table, read_size=12)[6:] == bytes(3) + entry
    assert build_param_pck(table, read_size=11)[6:] == bytes(2) + entry
    assert build_param_pck(table, read_size=10)[6:] == bytes(1) + entry
    assert build_param_pck(table, read_size=9)[6:] == entry


def test_size_is_estimated_at_12_bytes_a_parameter(table: ParamTable) -> None:
    assert estimate_size(table) == 84


@st.composite
def tables(draw: st.DrawFn) -> ParamTable:
    """Tables of any types, names and values."""
    names = draw(st.lists(st.text("AB_1", min_size=1, max_size=16), min_size=1, max_size=40, unique=True))
    rows = []
    values: dict[str, float] = {}
    for name in names:
        kind = draw(st.sampled_from([ParamType.INT8, ParamType.INT16, ParamType.INT32, ParamType.FLOAT]))
        limit = INTEGER_LIMITS.get(kind)
        finite = st.floats(width=32, allow_nan=False, allow_infinity=False)
        numbers = finite if limit is None else st.integers(-limit, limit - 1)
        rows.append(info(name, kind, draw(numbers)))
        values[name] = draw(numbers)
    table = make_table(*rows)
    for name, value in values.items():
        table.set(name, value)
    return table


@given(tables(), st.integers(1, 239), st.booleans())
def test_pymavlink_reads_any_list(table: ParamTable, read_size: int, with_defaults: bool) -> None:
    values, _ = decoded(build_param_pck(table, read_size=read_size, with_defaults=with_defaults))
    expected = [(param.name, param.raw, int(param.type)) for param in table]
    assert values == expected


@given(tables(), st.integers(4, 239))
def test_no_value_lies_across_a_boundary(table: ParamTable, read_size: int) -> None:
    end = 6
    for index, param in enumerate(table):
        # The list up to here ends with this value.
        end = len(build_param_pck(table, read_size=read_size, count=index + 1))
        width = {1: 1, 2: 2, 3: 4, 4: 4}[int(param.type)]
        assert (end - width) // read_size == (end - 1) // read_size
    assert end == len(build_param_pck(table, read_size=read_size))


@pytest.mark.parametrize(
    ("query", "expected"),
    [
        ("", PckQuery()),
        ("start=3", PckQuery(3)),
        ("count=65534", PckQuery(count=65534)),
        ("withdefaults=1", PckQuery(with_defaults=True)),
        ("withdefaults=0", PckQuery()),
        ("start=10&count=20&withdefaults=1", PckQuery(10, 20, True)),
        ("count=20&start=10&count=5", PckQuery(10, 5)),
        ("start= +7x", PckQuery(7)),
        ("start=&count=2", PckQuery(0, 2)),
        ("start=x9", PckQuery()),
        ("other=1&start=4", PckQuery(4)),
        ("restart=4", PckQuery(4)),
        ("start=1,count=2", PckQuery(1)),
    ],
)
def test_query(query: str, expected: PckQuery) -> None:
    assert parse_query(query) == expected


@pytest.mark.parametrize("query", ["start=65535", "count=65535", "withdefaults=2", "start=-1", "count=" + "9" * 200])
def test_query_out_of_range_is_refused(query: str) -> None:
    assert parse_query(query) is None


@given(st.text("startcounwihdefl=&?0123456789-+ "))
def test_any_query_is_read(query: str) -> None:
    parsed = parse_query(query)
    assert parsed is None or (0 <= parsed.start < 65535 and 0 <= parsed.count < 65535)


class TestUpload:
    def upload(self, entries: bytes, count: int, *, magic: int = 0x671B, longer: int = 0) -> bytes:
        return struct.pack("<HHH", magic, count, 6 + len(entries) + longer) + entries

    def test_parameters_are_read(self) -> None:
        entries = (
            b"\x01\x80VISO_TYPE\x02" + b"\x04\x45SCALE" + struct.pack("<f", 0.5) + b"\x03\x00X" + struct.pack("<i", -9)
        )
        assert parse_param_pck_upload(self.upload(entries, 3)) == (
            PackedParam("VISO_TYPE", ParamType.INT8, 2),
            PackedParam("VISO_SCALE", ParamType.FLOAT, np.float32(0.5)),
            PackedParam("X", ParamType.INT32, -9),
        )

    def test_what_follows_the_last_parameter_is_passed_over(self) -> None:
        assert parse_param_pck_upload(self.upload(b"\x01\x00A\x05rest", 1)) == (PackedParam("A", ParamType.INT8, 5),)

    def test_no_parameters_are_fine(self) -> None:
        assert parse_param_pck_upload(self.upload(b"", 0)) == ()

    @pytest.mark.parametrize(
        "entries",
        [
            b"\x11\x00A\x05\x06",  # a default
            b"\x00\x00A\x05",  # type 0
            b"\x05\x00A" + bytes(12),  # a vector
            b"\x01\x01A\x05",  # shares a character with nothing
            b"\x02\x00A\x05",  # value cut short
            b"\x01",  # entry cut short
            b"",  # no entry
            b"\0\x01\x00A\x05",  # padding
        ],
    )
    def test_malformed_entry_refuses_the_file(self, entries: bytes) -> None:
        assert parse_param_pck_upload(self.upload(entries, 1)) is None

    def test_name_longer_than_16_refuses_the_file(self) -> None:
        entries = b"\x01\xf0" + b"A" * 16 + b"\0" + b"\x01\x1fBC\0"
        assert parse_param_pck_upload(self.upload(entries, 2)) is None

    def test_other_magic_or_length_refuses_the_file(self) -> None:
        assert parse_param_pck_upload(self.upload(b"", 0, magic=0x671C)) is None
        assert parse_param_pck_upload(self.upload(b"", 0, longer=1)) is None
        assert parse_param_pck_upload(b"\x1b\x67\0\0\x06") is None

    @given(tables())
    def test_download_without_padding_can_be_uploaded(self, table: ParamTable) -> None:
        data = bytearray(build_param_pck(table, read_size=1))
        data[4:6] = struct.pack("<H", len(data))
        uploaded = parse_param_pck_upload(bytes(data))
        assert uploaded == tuple(PackedParam(param.name, param.type, param.raw) for param in table)

    @given(st.binary(max_size=60), st.integers(0, 5))
    def test_any_bytes_are_read(self, entries: bytes, count: int) -> None:
        uploaded = parse_param_pck_upload(self.upload(entries, count))
        assert uploaded is None or len(uploaded) == count


# A download, read back


@given(tables(), st.integers(1, 239), st.booleans(), st.integers(0, 400))
def test_download_is_read_as_far_as_it_goes(
    table: ParamTable, read_size: int, with_defaults: bool, cut_off: int
) -> None:
    data = build_param_pck(table, read_size=read_size, with_defaults=with_defaults)
    read = parse_param_pck(data)
    assert read is not None
    whole, total = read
    assert total == table.count
    assert [(one.name, one.type, one.value) for one in whole] == [(one.name, one.type, one.raw) for one in table]
    begun = parse_param_pck(data[: max(6, len(data) - cut_off)])
    assert begun is not None
    assert begun[0] == whole[: len(begun[0])]


@given(st.binary())
def test_any_download_is_read(data: bytes) -> None:
    parse_param_pck(data)
    parse_param_pck(b"\x1c\x67\x09\x00\x09\x00" + data)


def test_other_files_are_no_lists_of_parameters() -> None:
    assert parse_param_pck(b"FORMAT_VERSION 120\n") is None
    assert parse_param_pck(b"\x1b\x67") is None
