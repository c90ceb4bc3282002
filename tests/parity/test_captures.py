# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The firmware's answers to recorded streams are ours as well, release by release: records, texts, acknowledgements."""

import copy
import math
import struct
from collections import Counter
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega

from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM

if TYPE_CHECKING:
    from tests.parity.conftest import Replayed

# How many messages each capture holds, and how many records the firmware made of them.
CAPTURES = {
    "dropout": (1102, 2202),
    "flight_mav_extyaw": (3513, 3498),
    "flight_t265": (1929, 3828),
    "flight_voxl_reset": (1929, 3828),
    "mav": (1450, 1449),
    "mocap": (706, 705),
    "prearm": (995, 1948),
    "t265": (1025, 1990),
    "voxl": (915, 1828),
    "2026-02/mav": (1459, 1458),
    "2026-02/mocap_covariance": (507, 506),
    "2026-02/t265": (1035, 2010),
    "2026-04/mocap": (713, 712),
    "2026-04/speedcov": (1546, 1686),
    "2026-04/voxl": (913, 1824),
}

FIELDS = {structure.name: structure.fields for structure in LOG_STRUCTURE_FROM_VISUALODOM}
TIME_TOLERANCE_MS = 3
# Of the T265 and VOXL backends only: these depend on the attitude of the AHRS at that instant.
LINEAR_TOLERANCE = 2e-3
ANGLE_TOLERANCE_DEG = 0.2
LINEAR_FIELDS = {"PX", "PY", "PZ", "VX", "VY", "VZ"}
ANGLE_FIELDS = {"R", "P", "Y"}

# Texts of the firmware that we do not send, and texts of ours that it does not send.
TEXT_EXCEPTIONS: dict[str, tuple[list[str], list[str]]] = {
    # The firmware's inertial sensors disagree in this recording, so its checks do not pass for a moment and fail
    # again, which would show the failure unasked; ours do at 20 s, and 26 s in place of the firmware's 25 s. The last
    # two commands came 1.5 and 3.6 s after the stream ended, but carry its last time: a command makes no record.
    "prearm": (
        [
            "PreArm: VisOdom: yaw diff 22.9 deg (>10)",
            "PreArm: VisOdom: not healthy",
            "Arm: VisOdom: not healthy",
        ],
        [
            "PreArm: VisOdom: yaw diff 30.0 deg (>10)",
            "PreArm: VisOdom: yaw diff 22.6 deg (>10)",
            "PreArm: VisOdom: yaw diff 17.4 deg (>10)",
            "Arm: VisOdom: yaw diff 17.4 deg (>10)",
        ],
    ),
    # Another check had failed before in the firmware, so that this failure was no news there.
    "2026-04/voxl": ([], ["PreArm: VisOdom: yaw diff 22.5 deg (>10)"]),
}

Replays = Callable[[str], "Replayed"]
Line = dict[str, Any]


def float_of(bits: str) -> float:
    value: float = struct.unpack(">f", bytes.fromhex(bits))[0]
    return value


def is_close(field: str, recorded: object, ours: object, *, aligned: bool) -> bool:
    if field == "CTimeMS" and isinstance(recorded, int) and isinstance(ours, int):
        return abs(recorded - ours) <= TIME_TOLERANCE_MS
    if aligned and isinstance(recorded, str) and isinstance(ours, str):
        difference = float_of(recorded) - float_of(ours)
        if field in LINEAR_FIELDS:
            return abs(difference) <= LINEAR_TOLERANCE
        if field in ANGLE_FIELDS:
            return abs(math.remainder(difference, 360)) <= ANGLE_TOLERANCE_DEG
    return recorded == ours


def record_differences(recorded: list[Any], ours: list[Any], *, aligned: bool) -> Iterator[str]:
    if recorded[0] != ours[0] or len(recorded) != len(ours):
        yield f"{recorded} is not {ours}"
        return
    for field, theirs, value in zip(FIELDS[recorded[0]], recorded[1:], ours[1:], strict=True):
        if not is_close(field, theirs, value, aligned=aligned):
            yield f"{recorded[0]}.{field}: {theirs} is not {value}"


def differences(recorded: list[Line], ours: list[Line], *, aligned: bool) -> list[str]:
    found = [] if len(recorded) == len(ours) else [f"{len(recorded)} messages, {len(ours)} of ours"]
    for number, (theirs, line) in enumerate(zip(recorded, ours, strict=False), 2):
        for key in ("arrival_us", "type"):
            if theirs[key] != line[key]:
                found.append(f"line {number}: {key} {theirs[key]} is not {line[key]}")
        if len(theirs["out"]) != len(line["out"]):
            found.append(f"line {number}: {len(theirs['out'])} records, {len(line['out'])} of ours")
        for before, after in zip(theirs["out"], line["out"], strict=False):
            found += [f"line {number}: {text}" for text in record_differences(before, after, aligned=aligned)]
    return found


def is_about_visual_odom(text: str) -> bool:
    return text.startswith(("VisOdom: ", "PreArm: VisOdom: ", "Arm: VisOdom: "))


def without(texts: list[str], exceptions: list[str]) -> list[str]:
    """Leave out each exception once, the last of its kind; all of them must be there."""
    left = list(reversed(texts))
    for exception in exceptions:
        left.remove(exception)
    return left[::-1]


USUAL = {"mav", "t265", "voxl", "2026-02/t265", "2026-04/speedcov"}
"""One of each backend and release; the usual run takes these."""


@pytest.fixture(
    scope="session", params=[pytest.param(name, marks=() if name in USUAL else pytest.mark.slow) for name in CAPTURES]
)
def run(request: pytest.FixtureRequest, replayed: Replays) -> "Replayed":
    """Return one replay after the other; the tests of each come together."""
    return replayed(request.param)


def test_capture_is_complete(run: "Replayed") -> None:
    records = sum(len(line["out"]) for line in run.recorded)
    assert (len(run.recorded), records) == CAPTURES[run.name]


def test_every_record_is_the_firmwares(run: "Replayed") -> None:
    assert differences(run.recorded, run.ours, aligned=run.aligned) == []


def test_texts_about_visual_odometry_are_the_firmwares(run: "Replayed") -> None:
    theirs = [text for _, text in run.header["statustext"] if is_about_visual_odom(text)]
    ours = [text for _, _, text in run.texts if is_about_visual_odom(text)]
    only_theirs, only_ours = TEXT_EXCEPTIONS.get(run.name, ([], []))
    assert without(ours, only_ours) == without(theirs, only_theirs)


def test_texts_have_the_firmwares_severity(run: "Replayed") -> None:
    theirs = {text: severity for severity, text in run.header["statustext"]}
    assert [(severity, text) for _, severity, text in run.texts if severity != theirs.get(text, severity)] == []


def commands_of(recorded: list[Line]) -> list[int]:
    """Return the numbers of the commands of a capture."""
    frames = b"".join(bytes.fromhex(line["msg"]) for line in recorded if line["type"] == "COMMAND_LONG")
    messages = ardupilotmega.MAVLink(None).parse_buffer(frames) or []
    return [message.command for message in messages]


def test_commands_are_acknowledged_in_order(run: "Replayed") -> None:
    theirs = [command for command, _ in run.header["command_ack"]]
    assert [command for command, _ in run.acks] == theirs == commands_of(run.recorded)


def test_results_of_commands_are_the_firmwares(run: "Replayed") -> None:
    assert [tuple(ack) for ack in run.acks] == [tuple(ack) for ack in run.header["command_ack"]]


def test_every_message_has_a_verdict_with_a_reason(run: "Replayed") -> None:
    assert all(line["verdict"]["outcome"] and line["verdict"]["reason"] for line in run.ours)


def test_verdict_of_recorded_samples_says_whether_they_were_withheld(run: "Replayed") -> None:
    made = [line for line in run.ours if line["out"]]
    withheld = [bool(line["out"][0][FIELDS[line["out"][0][0]].index("Ign") + 1]) for line in made]
    assert [line["verdict"]["outcome"] == "ignored" for line in made] == withheld


def test_verdict_of_samples_without_a_record_is_dropped(run: "Replayed") -> None:
    outcomes = Counter(
        line["verdict"]["outcome"] for line in run.ours if line["type"] == "ODOMETRY" and not line["out"]
    )
    assert set(outcomes) <= {"dropped"}


# The comparison itself


def flipped(bits: str) -> str:
    return f"{int(bits, 16) ^ 1:08x}"


def bits_of(value: float) -> str:
    return struct.pack(">f", value).hex()


def first_pose(lines: list[Line]) -> list[Any]:
    pose: list[Any] = next(out for line in lines for out in line["out"] if out[0] == "VISP")
    return pose


def mutated(run: "Replayed", field: str, change: Callable[[Any], Any]) -> list[str]:
    """Return the differences after one field of the first VISP record has changed."""
    recorded = copy.deepcopy(run.recorded)
    pose = first_pose(recorded)
    index = FIELDS["VISP"].index(field) + 1
    pose[index] = change(first_pose(run.ours)[index])
    return differences(recorded, run.ours, aligned=run.aligned)


@pytest.mark.parametrize("field", ["PX", "R", "PErr", "AErr"])
def test_one_wrong_bit_is_one_difference(replayed: Replays, field: str) -> None:
    assert len(mutated(replayed("mav"), field, flipped)) == 1


@pytest.mark.parametrize("name", ["mav", "t265"])
@pytest.mark.parametrize("field", ["TimeUS", "RTimeUS", "Rst", "Ign", "Q"])
def test_wrong_integer_is_a_difference(replayed: Replays, name: str, field: str) -> None:
    assert len(mutated(replayed(name), field, lambda value: value + 1)) == 1


@pytest.mark.parametrize(("by_ms", "count"), [(3, 0), (4, 1), (-3, 0), (-4, 1)])
def test_corrected_time_may_differ_by_three_milliseconds(replayed: Replays, by_ms: int, count: int) -> None:
    assert len(mutated(replayed("mav"), "CTimeMS", lambda value: value + by_ms)) == count


@pytest.mark.parametrize(("field", "by", "count"), [("PX", 1e-3, 0), ("PX", 3e-3, 1), ("Y", 0.1, 0), ("Y", 0.3, 1)])
def test_aligned_pose_may_differ_by_its_tolerance(replayed: Replays, field: str, by: float, count: int) -> None:
    assert len(mutated(replayed("t265"), field, lambda bits: bits_of(float_of(bits) + by))) == count


def test_errors_of_an_aligned_pose_are_exact(replayed: Replays) -> None:
    assert len(mutated(replayed("t265"), "PErr", flipped)) == 1


def test_yaw_is_compared_across_north() -> None:
    assert is_close("Y", bits_of(359.95), bits_of(0.05), aligned=True)
    assert not is_close("Y", bits_of(359.95), bits_of(0.25), aligned=True)


def test_missing_record_is_a_difference(replayed: Replays) -> None:
    run = replayed("mav")
    recorded = [{**run.recorded[0], "out": []}, *run.recorded[1:]]
    assert len(differences(recorded, run.ours, aligned=False)) == 1


def test_missing_message_is_a_difference(replayed: Replays) -> None:
    run = replayed("mav")
    assert differences(run.recorded[:-1], run.ours, aligned=False) == ["1449 messages, 1450 of ours"]
