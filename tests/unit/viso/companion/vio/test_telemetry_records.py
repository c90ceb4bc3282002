# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Records as bytes, and outputs as plain values, and back."""

import json
import math
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.unit.viso.companion.vio.strategy_rig import make_frame, make_output
from viso.companion.vio.telemetry_records import (
    MAX_RECORD_BYTES,
    health_values,
    output_of,
    output_values,
    pack_record,
    read_records,
    unpack_records,
    warm_start_of,
)
from viso.companion.vio.types import VioHealth, VioOutput, VioState

RECORDS: list[dict[str, Any]] = [{"a": 1}, {"b": [1.5, None]}, {"c": "x" * 50}]
PACKED = [pack_record(record) for record in RECORDS]


def same_outputs(one: VioOutput, other: VioOutput | None) -> bool:
    return other is not None and json.dumps(output_values(one)) == json.dumps(output_values(other))


def through_json(values: Any) -> Any:
    return json.loads(json.dumps(values))


def test_record_is_length_crc_and_json() -> None:
    text = b'{"a":1,"b":null}'
    assert pack_record({"a": 1, "b": math.nan}) == struct.pack("<II", len(text), zlib.crc32(text)) + text


def test_whole_records_come_back() -> None:
    assert list(unpack_records(b"".join(PACKED))) == RECORDS


@pytest.mark.parametrize("cut", range(1, len(PACKED[2])))
def test_truncated_tail_is_left_out(cut: int) -> None:
    assert list(unpack_records(b"".join(PACKED)[:-cut])) == RECORDS[:2]


@pytest.mark.parametrize("at", range(8, len(PACKED[1])))
def test_damaged_record_is_passed_over(at: int) -> None:
    damaged = bytearray(PACKED[1])
    damaged[at] ^= 0x10
    assert list(unpack_records(PACKED[0] + damaged + PACKED[2])) == [RECORDS[0], RECORDS[2]]


def test_length_that_cannot_be_ends_the_records() -> None:
    nonsense = struct.pack("<II", MAX_RECORD_BYTES + 1, 0) + bytes(MAX_RECORD_BYTES + 1)
    assert list(unpack_records(PACKED[0] + nonsense + PACKED[2])) == RECORDS[:1]


@pytest.mark.parametrize("text", [b"[1,2]", b"{", b"\xff"])
def test_record_that_is_no_object_is_passed_over(text: bytes) -> None:
    assert list(unpack_records(struct.pack("<II", len(text), zlib.crc32(text)) + text + PACKED[0])) == RECORDS[:1]


def test_file_that_cannot_be_read_has_no_records(tmp_path: Path) -> None:
    assert list(read_records(tmp_path)) == []


@given(st.binary(max_size=200))
def test_any_bytes_unpack(data: bytes) -> None:
    assert all(isinstance(record, dict) for record in unpack_records(data))


@given(st.binary(max_size=60))
def test_records_before_any_bytes_come_back(data: bytes) -> None:
    assert list(unpack_records(b"".join(PACKED) + data))[:3] == RECORDS


def test_health_as_values() -> None:
    values = health_values(VioHealth(VioState.DEGRADED, 2, 0.5, "imu_gap"))
    assert values == {"state": "DEGRADED", "consecutive_lost": 2, "bias_norm": 0.5, "reason": "imu_gap"}


def test_output_comes_back_to_the_bit() -> None:
    output = make_output(make_frame(3), velocity_b=np.array([1 / 3, -2e-300, 1e17]))
    assert same_outputs(output, output_of(through_json(output_values(output))))


BREAKS: dict[str, Any] = {
    "frame_id": "no uuid",
    "relative_pose_T": {"R": [[1, 0, 0], [0, 1, 0], [0, 0, 2]], "t": [0, 0, 0]},
    "pose_covariance_6x6": None,
    "imu_bias": {},
    "feature_quality": {"tracked": -1},
    "emitted_at": None,
    "velocity_b": [1.0, None, 2.0],
    "world_T_body": 5,
}


@pytest.mark.parametrize(("field", "value"), BREAKS.items(), ids=BREAKS)
def test_output_that_is_not_valid_is_none(field: str, value: object) -> None:
    values = through_json(output_values(make_output(make_frame(3))))
    assert output_of(values | {field: value}) is None


@pytest.mark.parametrize("values", [None, 5, "x", [], {}])
def test_what_is_no_output_is_none(values: object) -> None:
    assert output_of(values) is None


def test_warm_start_is_where_the_output_was() -> None:
    output = make_output(make_frame(3))
    pose = warm_start_of(output)
    assert (pose.body_T_world @ output.world_T_body).t == pytest.approx([0, 0, 0], abs=1e-12)
    assert np.array_equal(pose.velocity_b, output.velocity_b)
    assert pose.bias is output.imu_bias
    assert pose.covariance is None
