# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What may be sent: the project's messages, pymavlink's, bytes."""

import math
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as dialect

from mav_handlers.wire.codec import Codec, Received
from mav_handlers.wire.messages import ODOMETRY, PARAM_SET
from tests.unit.viso.testing.sample_odometry import odometry
from viso.testing.sender import Sender


def read(frame: bytes) -> Received:
    codec = Codec(1, 1)
    codec.feed(frame)
    received = codec.next_received()
    assert isinstance(received, Received)
    return received


@pytest.fixture
def mav() -> Any:
    return dialect.MAVLink(None, srcSystem=77, srcComponent=78)


def test_senders_have_a_count_each() -> None:
    sender = Sender()
    headers = [read(sender.frame(odometry(), *ids)).header for ids in ((1, 197), (1, 197), (2, 197), (1, 197))]
    assert [(header.system_id, header.sequence) for header in headers] == [(1, 0), (1, 1), (2, 0), (1, 2)]


def test_message_of_pymavlink_is_the_same_as_the_project_s(mav: Any) -> None:
    still = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    zeros = [0.0] * 21
    message = mav.odometry_encode(1, 20, 12, 0.5, 0.0, 0.0, [1.0, 0.0, 0.0, 0.0], *still, zeros, zeros, quality=90)
    received = read(Sender().frame(message, 1, 197))
    assert received.message == odometry(1, x=0.5)
    assert (received.header.system_id, received.header.component_id) == (1, 197)


def test_texts_of_pymavlink_are_taken_as_bytes(mav: Any) -> None:
    message = mav.param_set_encode(1, 1, b"VISO_TYPE", 2.0, 9)
    assert read(Sender().frame(message, 1, 197)).message == PARAM_SET(1, 1, "VISO_TYPE", 2.0, 9)


def test_nan_is_a_value() -> None:
    covariance = (math.nan,) + (0.0,) * 20
    message = read(Sender().frame(odometry(pose_covariance=covariance), 1, 197)).message
    assert isinstance(message, ODOMETRY)
    assert math.isnan(message.pose_covariance[0])


@pytest.mark.parametrize("data", [b"abc", bytearray(b"abc"), memoryview(b"abc")])
def test_bytes_are_left_as_they_are(data: bytes | bytearray | memoryview) -> None:
    assert Sender().frame(data, 1, 197) == b"abc"


@pytest.mark.parametrize("message", ["abc", None, {"x": 1}, PARAM_SET])
def test_anything_else_is_refused(message: object) -> None:
    with pytest.raises(TypeError, match=r"send takes a message of mav_handlers\.wire\.messages, one of pymavlink's or"):
        Sender().frame(message, 1, 197)


@pytest.mark.parametrize("ids", [(0, 1), (256, 1), (1, 0), (1, 256)])
def test_ids_out_of_range_are_refused(ids: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="not between 1 and 255"):
        Sender().frame(odometry(), *ids)


def test_field_that_does_not_fit_is_refused() -> None:
    sender = Sender()
    with pytest.raises(ValueError, match=r"ODOMETRY.*a field does not fit its type"):
        sender.frame(replace(odometry(), quality=1000), 1, 197)
    assert read(sender.frame(odometry(), 1, 197)).header.sequence == 0


def test_message_that_nobody_here_knows_is_refused(mav: Any) -> None:
    message = mav.debug_encode(1, 2, 3.0)
    with pytest.raises(ValueError, match=r"DEBUG: the emulator knows the name alone; send its bytes: message\.pack"):
        Sender().frame(message, 1, 197)
