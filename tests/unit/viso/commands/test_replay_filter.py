# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The filter on the command line: its sensors, the outcome of samples in it, and when it navigated."""

import gzip
import json
import lzma
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import ODOMETRY
from tests.places import DATA, RECORDED
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.conftest import odometry

CAPTURE = RECORDED / "captures" / "mav.jsonl.gz"
SHORT = 30
PERIOD_US = 33_333
LOG = RECORDED / "logs" / "prearm.BIN.xz"
SHORT_BYTES = 300_000
ORDINARY = DATA / "ordinary" / "lane_switch.BIN.xz"
BY_EXT_NAV = [
    *("--param", "VISO_TYPE=1", "--param", "EK3_SRC1_POSXY=6", "--param", "EK3_SRC1_VELXY=6"),
    *("--param", "EK3_SRC1_POSZ=1", "--param", "EK3_SRC1_YAW=6", "--param", "GPS1_TYPE=0"),
]


@pytest.fixture
def serve(serve: Viso) -> Viso:
    """Return a function that serves for a moment to a client that has sent a pose."""
    return partial(serve, sent=(odometry(0),))


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """Return the first messages of a recorded capture: some 5 s from boot."""
    path = tmp_path / "short.jsonl"
    with gzip.open(CAPTURE, "rt", encoding="utf-8") as file:
        path.write_text("".join(line for _, line in zip(range(SHORT + 1), file, strict=False)))
    return path


def pose_line(arrival_us: int, message: ODOMETRY) -> str:
    return json.dumps({"arrival_us": arrival_us, "msg": Codec(1, 197).encode(message).hex()}) + "\n"


def write_capture(path: Path, x_at: Callable[[float], float]) -> Path:
    """Write a capture of 4 s of poses, whose place is north as a function of seconds since the first tells."""
    params = {f"EK3_SRC1_{what}": 6 for what in ("POSXY", "POSZ", "YAW")}
    with path.open("w") as file:
        file.write(json.dumps({"name": path.stem, "params": {"VISO_TYPE": 1, "GPS1_TYPE": 0, **params}}) + "\n")
        for number in range(120):
            arrival_us = 6_000_000 + number * PERIOD_US
            file.write(pose_line(arrival_us, odometry(arrival_us, x=x_at(1e-6 * number * PERIOD_US))))
    return path


@pytest.fixture
def leaping(tmp_path: Path) -> Path:
    """Return a capture of poses at rest, of which the last half second is 9 m off."""
    return write_capture(tmp_path / "leaping.jsonl", lambda t: 9.0 if t > 3.49 else 0.0)


@pytest.fixture
def speeding(tmp_path: Path) -> Path:
    """Return a capture of poses that speed up."""
    return write_capture(tmp_path / "speeding.jsonl", lambda t: 1.5 * max(0.0, t - 1.0) ** 2)


# replay


def replayed(viso: Viso, *args: str | Path) -> dict[str, Any]:
    outcome = viso("replay", *args, "--json")
    assert outcome.code == 0
    answer: dict[str, Any] = json.loads(outcome.out)
    return answer


ASSUMED = (
    "note: these parameters are not known; assumed so that the stream can be used: GPS1_TYPE=0, EK3_SRC1_POSXY=6, "
    "EK3_SRC1_VELXY=0, EK3_SRC1_POSZ=1, EK3_SRC1_VELZ=0, EK3_SRC1_YAW=6\n"
)


@pytest.fixture
def poses(tmp_path: Path) -> Path:
    """Return a trajectory of a second, at rest."""
    path = tmp_path / "poses.tum"
    path.write_text("".join(f"{number * 0.05:.2f} 0 0 -1 0 0 0 1\n" for number in range(20)))
    return path


@pytest.mark.slow
def test_stream_without_parameters_is_fused_with_those_that_fit(viso: Viso, poses: Path) -> None:
    outcome = viso("replay", poses, "--as", "vision", "--ekf", "--lead", "12", "--param", "VISO_TYPE=2", "--json")
    assert ASSUMED in outcome.err
    assert "fused" in {row["outcome"] for row in json.loads(outcome.out)["filter"]}
    assert "nothing of external" not in outcome.err


def test_sources_that_are_told_are_left_as_they_are(viso: Viso, poses: Path) -> None:
    outcome = viso("replay", poses, "--as", "vision", "--ekf", "--lead", "1", "--param", "EK3_SRC1_POSXY=0")
    assert "can be used: VISO_TYPE=1, GPS1_TYPE=0\n" in outcome.err


@pytest.mark.parametrize(
    ("viso_type", "reason"),
    [
        (1, "20 samples of pose refused: the estimator does not run yet"),
        (0, "20 VISION_POSITION_ESTIMATE dropped: "),
    ],
)
def test_replay_in_which_nothing_was_fused_ends_with_why(viso: Viso, poses: Path, viso_type: int, reason: str) -> None:
    outcome = viso("replay", poses, "--as", "vision", "--ekf", "--lead", "1", "--param", f"VISO_TYPE={viso_type}")
    assert ASSUMED in outcome.err
    assert f"note: nothing of external navigation was fused: {reason}" in outcome.err.splitlines()[-1]


@pytest.mark.slow
def test_replay_tells_what_the_filter_makes_of_a_stream(viso: Viso, leaping: Path) -> None:
    outcome = viso("replay", leaping, "--ekf")
    assert outcome.code == 0
    titles = (
        "Outcome of each message",
        "Outcome of each sample in the filter",
        "Innovations of the samples that were tested (a model's)",
        "By what the filter navigated (a model's)",
    )
    places = [outcome.out.index(title) for title in titles]
    assert places == sorted(places)
    assert "horizontal position gate" in outcome.out
    assert "EKF3 IMU0 is using external nav data" in outcome.out
    assert "absolute position" in outcome.out


@pytest.mark.slow
def test_replay_tells_machines_the_same_and_writes_lines_that_agree(viso: Viso, leaping: Path) -> None:
    answer = replayed(viso, leaping, "--ekf", "--records", "out.jsonl")
    rejected = [row for row in answer["filter"] if row["outcome"] == "rejected"]
    assert [(row["kind"], row["rule"], row["count"], row["model"]) for row in rejected] == [
        ("pose", "model_gate_position", 15, True)
    ]
    pose = next(row for row in answer["innovations"] if row["kind"] == "pose")
    assert (pose["rejected"], pose["unit"], pose["model"]) == (15, "m", True)
    assert pose["worst"] == pytest.approx(9.0, abs=0.1)
    assert pose["worst_ratio"] > 3
    modes = [(span["mode"], span["model"]) for span in answer["aiding"]]
    assert modes == [("none", True), ("absolute", True)]
    started = next(row for row in answer["texts"] if row["text"] == "EKF3 IMU0 is using external nav data")
    assert answer["aiding"][1]["start_us"] == started["time_us"]
    lines = [json.loads(line) for line in Path("out.jsonl").read_text().splitlines()]
    assert len(lines) == 120
    assert set(lines[0]) == {"arrival_us", "type", "out", "verdict", "filter"}
    found: dict[tuple[str, str], int] = {}
    for outcome in (outcome for line in lines for outcome in line["filter"]):
        key = outcome["kind"], outcome["rule"]
        found[key] = found.get(key, 0) + 1
    assert found == {(row["kind"], row["rule"]): row["count"] for row in answer["filter"]}


@pytest.mark.slow
def test_change_that_the_motion_cannot_contradict_is_told(viso: Viso, leaping: Path) -> None:
    answer = replayed(viso, leaping, "--ekf", "--set", "VISO_SCALE=1.1")
    (doubt,) = answer["doubts"]
    assert doubt.startswith("VISO_SCALE cannot be judged: with --imu follow the vehicle moves as the stream says")
    assert {row["name"] for row in answer["figures"]} >= {"rms_pose", "worst_ratio", "resets", "aiding_share"}
    shown = viso("replay", leaping, "--ekf", "--set", "VISO_QUAL_MIN=1").out
    assert "Figures of merit (the filter is a model)" in shown
    assert "cannot be judged" not in shown


def test_stream_that_is_no_log_has_no_motion_of_its_own(viso: Viso, leaping: Path) -> None:
    assert failed_with(viso("replay", leaping, "--imu", "log"), f"{leaping}: not a DataFlash log")


@pytest.mark.slow
def test_ordinary_log_is_flown_again_by_its_imu_records(viso: Viso) -> None:
    outcome = viso("replay", ORDINARY, "--imu", "log", "--set", "VISO_POS_X=0.5", "--json")
    assert "note: the vehicle moves by the log's IMU records\nnote: IMU of IMU 1, 25 Hz\n" in outcome.err
    answer = json.loads(outcome.out)
    figures = {row["name"]: row for row in answer["figures"]}
    assert figures["log_m"]["before"] < 0.1
    assert figures["ate_m"]["before"] < 0.1
    assert figures["nis"]["after"] > 2 * figures["nis"]["before"]
    assert figures["nis"]["chance"] is False
    assert answer["doubts"] == []


@pytest.mark.slow
def test_replay_without_the_filter_is_as_it_was(viso: Viso, capture: Path) -> None:
    answer = replayed(viso, capture, "--records", "out.jsonl")
    assert set(answer) == {"stream", "firmware", "firmware_reason", "verdicts", "texts"}
    assert "filter" not in json.loads(Path("out.jsonl").read_text().splitlines()[0])
    assert "filter" not in viso("replay", capture).out


@pytest.mark.slow
def test_vehicle_moves_as_the_stream_says_unless_told_otherwise(viso: Viso, speeding: Path) -> None:
    worst = {}
    for imu in ([], ["--imu", "follow"], ["--imu", "bench"]):
        answer = replayed(viso, speeding, "--ekf", *imu)
        worst[" ".join(imu)] = next(row["worst"] for row in answer["innovations"] if row["kind"] == "pose")
    assert worst[""] == worst["--imu follow"] < 0.5 * worst["--imu bench"]


@pytest.mark.slow
def test_replay_with_the_filter_twice_writes_the_same_bytes(viso: Viso, leaping: Path) -> None:
    noisy = ["--ekf", "--imu-error", "gyro_noise_deg_s_rthz=0.02", "--imu-seed", "3", "--param", "LOG_REPLAY=1"]
    outputs = [viso("replay", leaping, *noisy, "--log", name).out for name in ("first.BIN", "second.BIN")]
    assert outputs[0] == outputs[1]
    assert Path("first.BIN").read_bytes() == Path("second.BIN").read_bytes()
    viso("replay", leaping, *noisy, "--imu-seed", "4", "--log", "third.BIN")
    assert Path("third.BIN").read_bytes() != Path("first.BIN").read_bytes()


def test_empty_stream_has_nothing_to_tell_of_the_filter(viso: Viso, tmp_path: Path) -> None:
    (tmp_path / "empty.jsonl").write_text('{"name": "empty", "params": {}}\n')
    outcome = viso("replay", "empty.jsonl", "--ekf")
    assert outcome.code == 0
    assert "Innovations" not in outcome.out
    assert "nothing (constant position)" in outcome.out


@pytest.mark.parametrize(("args", "line"), [
    (["--ekf", "--ahrs", LOG], "--ekf and --ahrs: a vehicle that follows a log has no filter"),
    (["--ahrs", LOG, "--imu", "bench"], "--ahrs and --imu: a vehicle that follows a log has no sensors"),
    (["--imu", "gps"], "--imu gps: no such source; there are bench, script, follow, fly, hil, log"),
    (["--imu", "script"], "--imu script: not script:FILE"),
    (
        ["--imu-error", "baro_noise_m=loud"],
        "--imu-error 'baro_noise_m=loud': not NAME=NUMBER",
    ),
])  # fmt: skip
def test_option_of_the_filter_that_cannot_be_used_is_one_line(
    viso: Viso, serve: Viso, capture: Path, args: list[str | Path], line: str
) -> None:
    assert failed_with(viso("replay", capture, *args), line)
    if "--ekf" not in args:
        assert failed_with(serve(*args), line)


def test_script_that_is_not_there_is_one_line(viso: Viso, capture: Path) -> None:
    outcome = viso("replay", capture, "--imu", "script:none.toml")
    assert (outcome.code, outcome.out, outcome.err.count("\n")) == (2, "", 1)
    assert outcome.err.startswith("viso: none.toml: No such file or directory")


# serve


@pytest.mark.parametrize("imu", ["bench", "script:figure_eight", "follow", "hil"])
def test_vehicle_serves_with_sensors_of_every_kind(serve: Viso, imu: str) -> None:
    outcome = serve("--imu", imu, "--json", *BY_EXT_NAV)
    assert outcome.code == 0
    assert {row["rule"] for row in json.loads(outcome.out)["filter"]} == {"not_started"}


@pytest.mark.slow
def test_vehicle_serves_with_the_sensors_of_a_log(serve: Viso, tmp_path: Path) -> None:
    path = tmp_path / "short.BIN"
    with lzma.open(LOG) as log:
        path.write_bytes(log.read(SHORT_BYTES))
    assert serve("--imu", f"log:{path}", "--json").code == 0


def test_closing_counts_tell_machines_of_samples(serve: Viso) -> None:
    (row, other) = json.loads(serve("--json", *BY_EXT_NAV).out)["filter"]
    assert row == {
        "kind": "pose",
        "outcome": "refused",
        "rule": "not_started",
        "reason": "the estimator does not run yet",
        "count": 1,
        "model": False,
    }
    assert other["kind"] == "velocity"


def test_closing_tables_tell_of_samples(serve: Viso) -> None:
    outcome = serve(*BY_EXT_NAV)
    assert "filter: starting; until it is aligned, some 6 s after boot, it uses no sample" in outcome.out
    assert outcome.out.index("Outcome of each message") < outcome.out.index("Outcome of each sample")


def test_vehicle_that_follows_a_log_has_no_table_of_samples(serve: Viso) -> None:
    outcome = serve("--ahrs", LOG, "--param", "VISO_TYPE=1")
    assert "Outcome of each message" in outcome.out
    assert "Outcome of each sample" not in outcome.out


def test_lines_of_samples_are_among_those_of_messages(serve: Viso) -> None:
    lines = [json.loads(line) for line in serve("--verdicts", "json", *BY_EXT_NAV).out.splitlines()]
    assert [(line["type"], line["link"], line["model"]) for line in lines] == [
        ("FILTER", None, False),
        ("FILTER", None, False),
        ("ODOMETRY", "pair", False),
    ]


def test_lines_for_people_are_in_columns(serve: Viso) -> None:
    first = serve("--verdicts", "text", *BY_EXT_NAV).out.splitlines()[0]
    why = r"refused: the estimator does not run yet \(not_started\)"
    assert re.fullmatch(rf" +\d+\.\d{{3}} s  filter  pose at \d+\.\d{{3}} s  {why}", first)
