# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The firmware's answers to recorded streams are ours as well, release by release: records, texts, acknowledgements."""

import copy
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega

from ap_visualodom.log_structure import LOG_STRUCTURE_FROM_VISUALODOM
from tests.places import PARITY
from viso.compare.captures import Capture, ack_differences, record_differences, text_differences
from viso.compare.differences import Difference, is_equal
from viso.compare.recordings import kind_of
from viso.compare.tolerances import ABOUT_VISUAL_ODOM, CAPTURE, tolerances_of

if TYPE_CHECKING:
    from tests.parity.conftest import Replayed

# How many messages each capture holds, and how many records the firmware made of them.
CAPTURES = {
    "4.6/fl_gps_t265": (2310, 4582),
    "4.6/fl_yawdrift": (1814, 3600),
    "4.6/mocap": (797, 796),
    "4.6/odo_wild": (1044, 1720),
    "4.6/resets": (1985, 1984),
    "4.6/speedcov": (1456, 1588),
    "4.6/three_sets": (2102, 2094),
    "2025-07/dropout": (1102, 2202),
    "2025-07/flight_mav_extyaw": (3513, 3498),
    "2025-07/flight_t265": (1929, 3828),
    "2025-07/flight_voxl_reset": (1929, 3828),
    "2025-07/mav": (1450, 1449),
    "2025-07/mocap": (706, 705),
    "2025-07/prearm": (995, 1948),
    "2025-07/t265": (1025, 1990),
    "2025-07/voxl": (915, 1828),
    "2026-02/mav": (1459, 1458),
    "2026-02/mocap_covariance": (507, 506),
    "2026-02/t265": (1035, 2010),
    "4.7/mixed_all": (1142, 1289),
    "4.7/mocap": (797, 796),
    "4.7/resets": (1985, 1984),
    "4.7/speedcov": (1456, 1588),
    "4.7/three_sets": (2087, 2079),
    "2026-04/mocap": (713, 712),
    "2026-04/speedcov": (1546, 1686),
    "2026-04/voxl": (913, 1824),
}

FIELDS = {structure.name: structure.fields for structure in LOG_STRUCTURE_FROM_VISUALODOM}

Replays = Callable[[str], "Replayed"]
Line = dict[str, Any]


ANY = "2026-02/mocap_covariance"
"""A short one of the MAV backend, which depends on nothing that the vehicle knows."""
USUAL = {ANY, "2025-07/t265", "2025-07/voxl"}
"""One of each backend; the usual run takes these."""


@pytest.fixture(
    scope="session", params=[pytest.param(name, marks=() if name in USUAL else pytest.mark.slow) for name in CAPTURES]
)
def run(request: pytest.FixtureRequest, replayed: Replays) -> "Replayed":
    """Return one replay after the other; the tests of each come together."""
    return replayed(request.param)


def test_capture_is_complete(run: "Replayed") -> None:
    records = sum(len(line["out"]) for line in run.recorded.lines)
    assert (len(run.recorded.lines), records) == CAPTURES[run.name]


def test_every_record_is_the_firmwares(run: "Replayed") -> None:
    assert list(record_differences(run.recorded.lines, run.ours.lines, run.recorded.backend)) == []


def test_texts_are_the_firmwares(run: "Replayed") -> None:
    assert any(text.startswith(ABOUT_VISUAL_ODOM) for _, text in run.ours.texts) or run.recorded.backend == 1
    assert list(text_differences(run.recorded, run.ours.texts)) == []


def commands_of(recorded: Sequence[Line]) -> list[int]:
    """Return the numbers of the commands of a capture."""
    frames = b"".join(bytes.fromhex(line["msg"]) for line in recorded if line["type"] == "COMMAND_LONG")
    messages = ardupilotmega.MAVLink(None).parse_buffer(frames) or []
    return [message.command for message in messages]


def test_commands_are_acknowledged_in_order(run: "Replayed") -> None:
    theirs = [command for command, _ in run.recorded.header["command_ack"]]
    assert [command for command, _ in run.ours.acks] == theirs == commands_of(run.recorded.lines)


def test_results_of_commands_are_the_firmwares(run: "Replayed") -> None:
    assert list(ack_differences(run.recorded.header["command_ack"], run.ours.acks)) == []


def test_release_is_told_by_the_capture_or_the_log_beside_it(run: "Replayed") -> None:
    release, _, stem = run.name.partition("/")
    path = PARITY / release / "captures" / f"{stem}.jsonl.gz"
    told = kind_of(path).judged_by(path)
    assert told is not None
    assert told.firmware.name == release


def test_every_message_has_a_verdict_with_a_reason(run: "Replayed") -> None:
    assert all(line["verdict"]["outcome"] and line["verdict"]["reason"] for line in run.ours.lines)


def test_verdict_of_recorded_samples_says_whether_they_were_withheld(run: "Replayed") -> None:
    made = [line for line in run.ours.lines if line["out"] and line["out"][0][0] in ("VISP", "VISV")]
    withheld = [bool(line["out"][0][FIELDS[line["out"][0][0]].index("Ign") + 1]) for line in made]
    assert [line["verdict"]["outcome"] == "ignored" for line in made] == withheld


def test_verdict_of_samples_without_a_record_is_dropped(run: "Replayed") -> None:
    outcomes = Counter(
        line["verdict"]["outcome"] for line in run.ours.lines if line["type"] == "ODOMETRY" and not line["out"]
    )
    assert set(outcomes) <= {"dropped"}


# The comparison itself


def flipped(bits: str) -> str:
    return f"{int(bits, 16) ^ 1:08x}"


def float_of(bits: str) -> float:
    value: float = struct.unpack(">f", bytes.fromhex(bits))[0]
    return value


def bits_of(value: float) -> str:
    return struct.pack(">f", value).hex()


def first_pose(lines: Sequence[Line]) -> list[Any]:
    pose: list[Any] = next(out for line in lines for out in line["out"] if out[0] == "VISP")
    return pose


def differences(run: "Replayed", recorded: Sequence[Line]) -> list[Difference]:
    """Return the differences of what we made of a capture from what may have been recorded."""
    return list(record_differences(recorded, run.ours.lines, run.recorded.backend))


def mutated(run: "Replayed", field: str, change: Callable[[Any], Any]) -> list[Difference]:
    """Return the differences, up to the first VISP record, after one field of that has changed."""
    number = next(i for i, line in enumerate(run.ours.lines, 1) if any(out[0] == "VISP" for out in line["out"]))
    ours, recorded = run.ours.lines[:number], run.recorded.lines[: number - 1]
    changed = copy.deepcopy(run.recorded.lines[number - 1])
    index = FIELDS["VISP"].index(field) + 1
    first_pose([changed])[index] = change(first_pose(ours)[index])
    return list(record_differences([*recorded, changed], ours, run.recorded.backend))


@pytest.mark.parametrize("field", ["PX", "R", "PErr", "AErr"])
def test_one_wrong_bit_is_one_difference(replayed: Replays, field: str) -> None:
    assert [one.field for one in mutated(replayed(ANY), field, flipped)] == [f"VISP.{field}"]


@pytest.mark.parametrize("name", [ANY, "2025-07/t265"])
@pytest.mark.parametrize("field", ["TimeUS", "RTimeUS", "Rst", "Ign", "Q"])
def test_wrong_integer_is_a_difference(replayed: Replays, name: str, field: str) -> None:
    assert len(mutated(replayed(name), field, lambda value: value + 1)) == 1


@pytest.mark.parametrize(("by_ms", "count"), [(3, 0), (4, 1), (-3, 0), (-4, 1)])
def test_corrected_time_may_differ_by_three_milliseconds(replayed: Replays, by_ms: int, count: int) -> None:
    assert len(mutated(replayed(ANY), "CTimeMS", lambda value: value + by_ms)) == count


@pytest.mark.parametrize(("field", "by", "count"), [("PX", 1e-3, 0), ("PX", 3e-3, 1), ("Y", 0.1, 0), ("Y", 0.3, 1)])
def test_aligned_pose_may_differ_by_its_tolerance(replayed: Replays, field: str, by: float, count: int) -> None:
    assert len(mutated(replayed("2025-07/t265"), field, lambda bits: bits_of(float_of(bits) + by))) == count


def test_errors_of_an_aligned_pose_are_exact(replayed: Replays) -> None:
    assert len(mutated(replayed("2025-07/t265"), "PErr", flipped)) == 1


def test_yaw_is_compared_across_north() -> None:
    yaw = tolerances_of(CAPTURE, backend=2)["VISP.Y"]
    north = np.float32(359.95)
    assert is_equal("VISP.Y", north, np.float32(0.05), yaw)
    assert not is_equal("VISP.Y", north, np.float32(0.25), yaw)


def test_pose_of_the_mav_backend_has_no_tolerance_but_in_time() -> None:
    assert set(tolerances_of(CAPTURE, backend=1)) == {"VISP.CTimeMS", "VISV.CTimeMS"}


def test_missing_record_is_a_difference(replayed: Replays) -> None:
    run = replayed(ANY)
    lines = run.recorded.lines
    assert len(differences(run, [{**lines[0], "out": []}, *lines[1:]])) == 1


def test_missing_message_is_a_difference(replayed: Replays) -> None:
    run = replayed(ANY)
    assert differences(run, run.recorded.lines[:-1]) == [Difference("end", "messages", "506", "507")]


def test_difference_names_line_field_values_and_unit(replayed: Replays) -> None:
    [found] = mutated(replayed(ANY), "PX", lambda _bits: bits_of(7.25))
    assert (found.field, found.recorded, found.unit) == ("VISP.PX", "7.25", "m")
    assert found.place.startswith("line ")


def changed_text(run: "Replayed", texts: list[list[Any]]) -> list[Difference]:
    header = {**run.recorded.header, "statustext": texts}
    return list(text_differences(Capture(header, ()), run.ours.texts))


def test_changed_missing_and_graver_text_are_differences(replayed: Replays) -> None:
    run = replayed("2025-07/voxl")
    texts = run.recorded.header["statustext"]
    index = next(index for index, (_, text) in enumerate(texts) if text == "VisOdom: reset")
    severity, text = texts[index]
    other = [*texts[:index], [severity, "VisOdom: other"], *texts[index + 1 :]]
    assert changed_text(run, other) == [Difference("texts", "STATUSTEXT.text", "VisOdom: other", text)]
    assert changed_text(run, texts[:index] + texts[index + 1 :]) == [
        Difference("texts", "STATUSTEXT.text", "nothing", text)
    ]
    graver = [[0, said] if said == text else [level, said] for level, said in texts]
    assert [one.field for one in changed_text(run, graver)] == ["STATUSTEXT.severity"]


def test_changed_and_missing_acknowledgement_are_differences(replayed: Replays) -> None:
    acks = replayed("2025-07/t265").ours.acks
    assert list(ack_differences(acks, acks)) == []
    [(command, result)] = acks
    assert [one.recorded for one in ack_differences([(command, result + 1)], acks)] == [
        f"command {command} result {result + 1}"
    ]
    assert [one.recorded for one in ack_differences([], acks)] == ["nothing"]
