# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Every recorded output of the firmware is reproduced, and a difference would be seen."""

import gzip
import json
from functools import cache
from typing import Any

import pytest

from ap_visualodom.release import JULY_2025
from tests.places import RECORDED
from viso.compare.vectors import line_differences
from viso.replay.vectors import VectorError, parse_line, recompute

VECTORS = RECORDED / "vectors"

# How many outputs each recording holds; fewer would mean that something was not compared.
OUTPUTS = {"visual_odom": 41061, "ap_math": 18220, "jitter_correction": 13220}
CHUNKS = 6


@cache
def lines_of(name: str) -> tuple[str, ...]:
    with gzip.open(VECTORS / f"{name}.jsonl.gz", "rt", encoding="utf-8") as file:
        return tuple(file)


def recompute_text(text: str) -> str:
    return json.dumps(recompute(parse_line(text), JULY_2025))


@cache
def parsed(name: str) -> tuple[Any, ...]:
    """Return the lines of a recording, for looking at alone."""
    return tuple(json.loads(line) for line in lines_of(name))


def compare(recorded: tuple[Any, ...]) -> tuple[int, int]:
    """Return the numbers of outputs and of differences."""
    found = [one for line in recorded for one in line_differences(1, line, recompute(line, JULY_2025))]
    return sum(map(output_count, recorded)), len(found)


def output_count(line: object) -> int:
    if isinstance(line, dict):
        return len(line.get("steps") or line["samples"])
    return 1


def example(name: str, number: int = 0) -> str:
    return lines_of(name)[number]


@pytest.mark.parametrize("chunk", range(CHUNKS))
@pytest.mark.parametrize("name", OUTPUTS)
def test_port_reproduces_recorded_outputs(name: str, chunk: int) -> None:
    outputs, differences = compare(parsed(name)[chunk::CHUNKS])
    assert outputs > 0
    assert differences == 0


@pytest.mark.parametrize(("name", "expected"), OUTPUTS.items())
def test_recording_is_complete(name: str, expected: int) -> None:
    assert sum(map(output_count, parsed(name))) == expected


def test_recording_covers_every_operation() -> None:
    operations = {step[0] for line in parsed("visual_odom") for step in line["steps"]}
    assert operations == {
        *("time_us", "ahrs", "pose", "pose_euler", "speed", "delta", "request_align_yaw"),
        *("align_position", "param", "pre_arm_check", "status"),
    }


def test_recording_covers_every_consequence() -> None:
    steps = (step for line in parsed("visual_odom") for step in line["steps"])
    consequences = {out[0] for step in steps for out in step[-1]["out"]}
    assert consequences == {"extnav", "extvel", "odom", "text", "log", "internal_error", "prearm", "status"}


def test_recording_covers_every_rotation() -> None:
    calls = [json.loads(line) for line in lines_of("ap_math")]
    assert {call[1][0] for call in calls if call[0] == "v_rotate"} == set(range(44))


def flip_lowest_bit(bits: str) -> str:
    return f"{int(bits, 16) ^ 1:08x}"


def test_one_wrong_bit_of_a_maths_result_is_a_difference() -> None:
    function, args, result = json.loads(example("ap_math", 6))
    mutated = [function, args, [flip_lowest_bit(result[0]), *result[1:]]]
    assert compare((mutated,)) == (1, 1)


def test_one_wrong_bit_of_a_record_is_one_difference() -> None:
    line = json.loads(example("visual_odom"))
    record = next(out for step in line["steps"] for out in step[-1]["out"] if out[:2] == ["log", "VISP"])
    record[5] = flip_lowest_bit(record[5])
    assert compare((line,)) == (len(line["steps"]), 1)


def test_one_microsecond_in_a_jitter_sequence_is_one_difference() -> None:
    line = json.loads(example("jitter_correction"))
    line["samples"][-1][2] += 1
    assert compare((line,)) == (len(line["samples"]), 1)


def test_missing_consequence_is_a_difference() -> None:
    line = json.loads(example("visual_odom"))
    step = next(step for step in line["steps"] if step[-1]["out"])
    step[-1]["out"] = []
    assert compare((line,)) == (len(line["steps"]), 1)


def test_negative_zero_differs_from_zero() -> None:
    assert compare((["wrap_360", ["00000000"], ["80000000"]],)) == (1, 1)


def test_recorded_outputs_of_scenarios_are_not_looked_at() -> None:
    line = json.loads(example("visual_odom"))
    bare = {**line, "steps": [step[:-1] for step in line["steps"]]}
    assert recompute_text(json.dumps(bare)) == recompute_text(example("visual_odom"))


def test_recorded_results_of_maths_calls_are_not_looked_at() -> None:
    line = example("ap_math", 6)
    assert recompute_text(json.dumps(json.loads(line)[:2])) == recompute_text(line)


def test_recorded_times_of_jitter_sequences_are_not_looked_at() -> None:
    line = json.loads(example("jitter_correction"))
    bare = {**line, "samples": [sample[:2] for sample in line["samples"]]}
    assert recompute_text(json.dumps(bare)) == recompute_text(example("jitter_correction"))


@pytest.mark.parametrize(
    ("text", "result"),
    [
        ('["q_from_rotation", [50]]', ["3f800000", "00000000", "00000000", "00000000"]),
        ('["v_rotate", [50, ["3f800000", "40000000", "40400000"]]]', ["3f800000", "40000000", "40400000"]),
    ],
)
def test_maths_call_with_an_unknown_rotation_has_a_result(text: str, result: list[str]) -> None:
    assert json.loads(recompute_text(text))[2] == result


def test_recomputed_line_keeps_name_and_parameters() -> None:
    line, ours = json.loads(example("visual_odom")), json.loads(recompute_text(example("visual_odom")))
    assert (ours["name"], ours["params"]) == (line["name"], line["params"])


def test_recomputing_twice_gives_the_same_text() -> None:
    assert recompute_text(example("visual_odom", 1)) == recompute_text(example("visual_odom", 1))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not JSON"),
        ("", "not JSON"),
        ("17", "neither a scenario"),
        ('"pose"', "neither a scenario"),
        ("{}", "neither a scenario"),
        ("[]", r"\[function, \[arguments"),
        ('["wrap_360"]', r"\[function, \[arguments"),
        ('["wrap_360", "00000000"]', r"\[function, \[arguments"),
        ('["cosh", ["00000000"]]', "unknown function 'cosh'"),
        ('["wrap_360", []]', "wrap_360: "),
        ('["wrap_360", ["00000000", "00000000"]]', "wrap_360: "),
        ('["wrap_360", [1.5]]', "wrap_360: not a float in hex: 1.5"),
        ('["wrap_360", ["0x000000"]]', "wrap_360: "),
        ('["v_length", [["00000000", "00000000"]]]', "v_length: not a list of 3 floats"),
        ('["q_from_rotation", [[1]]]', "q_from_rotation: "),
        ('{"samples": 1, "max_lag_ms": 500, "convergence_loops": 100}', "a jitter sequence needs"),
        ('{"samples": [], "convergence_loops": 100}', "a jitter sequence needs"),
        ('{"samples": [], "max_lag_ms": 500, "convergence_loops": "100"}', "a jitter sequence needs"),
        ('{"steps": []}', "a scenario needs"),
        ('{"steps": {}, "params": {}}', "a scenario needs"),
        ('{"steps": [], "params": {"SCALE": null}}', "parameter SCALE"),
    ],
)
def test_malformed_line_is_reported(text: str, message: str) -> None:
    with pytest.raises(VectorError, match=message):
        recompute_text(text)


QUATERNION = ["3f800000", "00000000", "00000000", "00000000"]
VECTOR = ["00000000", "00000000", "00000000"]
AHRS = {"initialised": True, "dcm_yaw_initialised": True, "using_extnav_for_yaw": False, "yaw": "00000000"}


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("time_us", "not a list"),
        ([], "not a list"),
        (["fly"], "unknown step 'fly'"),
        ([7], "unknown step 7"),
        (["time_us"], "step 'time_us'"),
        (["time_us", 1, 2], "step 'time_us'"),
        (["time_us", "soon"], "step 'time_us'"),
        (["time_us", 1.5], "step 'time_us'"),
        (["pose", 1, 2, VECTOR, QUATERNION, "00000000", "00000000", 0], "step 'pose'"),
        (["pose", 1, 2, VECTOR, VECTOR, "00000000", "00000000", 0, 0], "not a list of 4 floats"),
        (["pose", 1, 2, VECTOR, QUATERNION, 0.5, "00000000", 0, 0], "not a float in hex: 0.5"),
        (["pose", 1, 2, VECTOR, QUATERNION, "00000000", "00000000", 0, "good"], "step 'pose'"),
        (["pose_euler", 1, 2, VECTOR, QUATERNION, "00000000", "00000000", 0, 0], "not a list of 3 floats"),
        (["speed", 1, 2, "fast", 0, 0], "not a list of 3 floats"),
        (["delta", 1, None, VECTOR, VECTOR, "00000000"], "step 'delta'"),
        (["ahrs", AHRS], "step 'ahrs': 'quat'"),
        (["ahrs", {**AHRS, "quat": VECTOR, "pos": None}], "not a list of 4 floats"),
        (["ahrs", []], "step 'ahrs'"),
        (["request_align_yaw", 1], "step 'request_align_yaw'"),
        (["align_position", True], "step 'align_position'"),
        (["param", "SPEED", 1], "VISO_SPEED: no such"),
        (["param", "SCALE", 1.5], "parameter SCALE"),
        (["param", "POS", "00000000"], "not a list of 3 floats"),
        (["param", "TYPE", "7fc00000"], "step 'param'"),
        (["status", 1], "step 'status'"),
    ],
)
def test_malformed_step_is_reported_with_its_number(step: object, message: str) -> None:
    line = {"name": "x", "params": {"TYPE": 1}, "steps": [["time_us", 0], step]}
    with pytest.raises(VectorError, match=f"^step 1: .*{message}"):
        recompute_text(json.dumps(line))


@pytest.mark.parametrize(
    "text",
    [
        '{"steps": [], "params": {"SPEED": 1}}',
        '{"steps": [], "params": {"SCALE": "one"}}',
        '{"steps": [], "params": {"TYPE": "7f800000"}}',
        '{"steps": [[{"out": []}]], "params": {}}',
        '{"steps": [["param", "SCALE", 1' + "0" * 400 + ']], "params": {}}',
        "1" * 5000,
        "[" * 100_000,
    ],
    ids=["unknown", "no float", "no integer", "no operation", "too large", "too many digits", "too deep"],
)
def test_line_that_cannot_be_used_is_a_vector_error(text: str) -> None:
    with pytest.raises(VectorError):
        recompute_text(text)


@pytest.mark.parametrize(
    "step",
    [
        ["pose", 1, 2, VECTOR, QUATERNION, "00000000", "00000000", "0", 0],
        ["pose", "1", None, VECTOR, QUATERNION, "00000000", "00000000", 0, 0],
        ["pose", 1, 2, VECTOR, QUATERNION, "00000000", "00000000", 0, 0.5],
        ["pose_euler", 1, True, VECTOR, VECTOR, "00000000", "00000000", 0, 0],
        ["speed", 1, 2.5, VECTOR, 0, 0],
        ["delta", 0, 1.5, VECTOR, VECTOR, "00000000"],
    ],
)
def test_step_with_something_else_for_an_integer_is_a_vector_error(step: object) -> None:
    with pytest.raises(VectorError):
        recompute_text(json.dumps({"params": {"TYPE": 1}, "steps": [step]}))


@pytest.mark.parametrize("sample", [1, [], [1], ["1", 2], [1, None], [1.5, 2]])
def test_malformed_jitter_sample_is_reported_with_its_number(sample: object) -> None:
    line = {"samples": [[0, 0], sample], "max_lag_ms": 500, "convergence_loops": 100}
    with pytest.raises(VectorError, match=r"^sample 1: "):
        recompute_text(json.dumps(line))
