# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What telemetry records hold: outputs and healths as plain values, and outputs back from them."""

import dataclasses
import json
import struct
import uuid
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from viso.companion.vio.json_log import compact_json
from viso.companion.vio.se3 import SE3
from viso.companion.vio.types import FeatureQuality, ImuBias, VioHealth, VioOutput, WarmStartPose

Record = Mapping[str, object]

MAX_RECORD_BYTES: Final = 1 << 20
_HEADER: Final = struct.Struct("<II")  # length and CRC-32 of the JSON text that follows


def pack_record(record: Record) -> bytes:
    """Return a record as the bytes that go into a file."""
    payload = compact_json(record).encode()
    return _HEADER.pack(len(payload), zlib.crc32(payload)) + payload


def unpack_records(data: bytes) -> Iterator[dict[str, Any]]:
    """Yield the records of a file's bytes that are whole.

    One whose CRC differs is passed over; where a length cannot be, or the bytes end, so do the records.
    """
    at = 0
    while at + _HEADER.size <= len(data):
        length, crc = _HEADER.unpack_from(data, at)
        at += _HEADER.size
        if length > min(MAX_RECORD_BYTES, len(data) - at):
            return
        payload = data[at : at + length]
        at += length
        if zlib.crc32(payload) == crc and (record := _parsed(payload)) is not None:
            yield record


def _parsed(payload: bytes) -> dict[str, Any] | None:
    try:
        record = json.loads(payload)
    except ValueError:
        return None
    return record if isinstance(record, dict) else None


def read_records(path: Path) -> Iterator[dict[str, Any]]:
    """Yield the records of a file that are whole; none if it cannot be read."""
    try:
        data = path.read_bytes()
    except OSError:
        return
    yield from unpack_records(data)


def health_values(health: VioHealth) -> dict[str, object]:
    """Return a health as plain values."""
    return dataclasses.asdict(health) | {"state": health.state.value}


def _pose_values(pose: SE3) -> dict[str, object]:
    return {"R": pose.R.tolist(), "t": pose.t.tolist()}


def output_values(output: VioOutput) -> dict[str, object]:
    """Return an output as plain values; :func:`output_of` reads them back, to the bit."""
    return {
        "frame_id": str(output.frame_id),
        "relative_pose_T": _pose_values(output.relative_pose_T),
        "pose_covariance_6x6": output.pose_covariance_6x6.tolist(),
        "imu_bias": {"accel": output.imu_bias.accel.tolist(), "gyro": output.imu_bias.gyro.tolist()},
        "feature_quality": dataclasses.asdict(output.feature_quality),
        "emitted_at": output.emitted_at,
        "keyframe_id": str(output.keyframe_id),
        "is_keyframe": output.is_keyframe,
        "velocity_b": output.velocity_b.tolist(),
        "world_T_body": _pose_values(output.world_T_body),
    }


def output_of(values: Any) -> VioOutput | None:
    """Return the output of plain values, or None if they are none, or no valid one."""
    try:
        return VioOutput(
            frame_id=uuid.UUID(values["frame_id"]),
            relative_pose_T=SE3(**values["relative_pose_T"]),
            pose_covariance_6x6=values["pose_covariance_6x6"],
            imu_bias=ImuBias(**values["imu_bias"]),
            feature_quality=FeatureQuality(**values["feature_quality"]),
            emitted_at=int(values["emitted_at"]),
            keyframe_id=uuid.UUID(values["keyframe_id"]),
            is_keyframe=bool(values["is_keyframe"]),
            velocity_b=values["velocity_b"],
            world_T_body=SE3(**values["world_T_body"]),
        )
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


def warm_start_of(output: VioOutput) -> WarmStartPose:
    """Return the state of an output as one to start from, with default sigmas: nobody knows how long ago that was."""
    return WarmStartPose(output.world_T_body.inverse(), output.velocity_b, output.imu_bias)
