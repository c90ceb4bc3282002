# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The batch port gives the firmware's bits where there is a recording, and the scalar port's where there is none."""

import gzip
import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ap_visualodom import batch
from tests.parity.batch_scenario import SAMPLES, BatchScenario, Step, expected_of, outputs_of
from tests.places import DATA
from viso.files.float_bits import bits_of, json_value
from viso.firmware.releases import PROFILES
from viso.logs.recorded import read_recorded_states
from viso.options.ahrs import AhrsChoice, ahrs_maker
from viso.replay.port_alone import PortReplay, following, never_aligned, replay_port
from viso.replay.run import ReplayOutcome, ReplaySetup, run_replay
from viso.replay.vectors import Scenario
from viso.streams.stream_kinds import Stream, read_capture, read_stream

VECTORS = {"4.7-dev": DATA / "vectors", "2026-02": DATA / "2026-02" / "vectors"}
SAMPLE_COUNTS = {"4.7-dev": 13589, "2026-02": 13648}


@cache
def lines_of(release: str) -> tuple[str, ...]:
    with gzip.open(VECTORS[release] / "visual_odom.jsonl.gz", "rt", encoding="utf-8") as file:
        return tuple(file)


def scenarios(release: str, chosen: slice) -> Iterator[dict[str, Any]]:
    yield from map(json.loads, lines_of(release)[chosen])


def compare(scenario: dict[str, Any], release: str) -> list[str]:
    """Return what of a scenario the batch port does otherwise than the firmware."""
    steps = scenario["steps"]
    made = BatchScenario(scenario["params"], PROFILES[release].visual_odom).run_all([step[:-1] for step in steps])
    names = ("samples", "everything else")
    parts = zip(names, made, expected_of(steps), strict=True)
    return [f"{scenario['name']}: {name}" for name, ours, theirs in parts if ours != theirs]


def differences(release: str, chosen: slice) -> list[str]:
    return [text for scenario in scenarios(release, chosen) for text in compare(scenario, release)]


@pytest.mark.parametrize("release", VECTORS)
def test_recorded_scenarios_give_the_firmwares_bits(release: str) -> None:
    assert differences(release, slice(0, None, 12)) == []


@pytest.mark.parametrize("release", VECTORS)
def test_recorded_scenarios_give_the_firmwares_bits_with_arrays_for_single_samples(
    release: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "SHORT_ROWS", 0)
    assert differences(release, slice(1, None, 24)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("short", "chosen"), [(batch.SHORT_ROWS, slice(None)), (0, slice(2, None, 4))])
@pytest.mark.parametrize("release", VECTORS)
def test_all_recorded_scenarios_give_the_firmwares_bits(
    release: str, short: int, chosen: slice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(batch, "SHORT_ROWS", short)
    assert differences(release, chosen) == []


@pytest.mark.slow
@pytest.mark.parametrize("release", VECTORS)
def test_every_recorded_sample_was_compared(release: str) -> None:
    steps = (step for scenario in scenarios(release, slice(None)) for step in scenario["steps"])
    assert sum(step[0] in SAMPLES for step in steps) == SAMPLE_COUNTS[release]


def test_one_wrong_bit_is_a_difference() -> None:
    scenario = next(scenarios("4.7-dev", slice(1)))
    record = next(out for step in scenario["steps"] for out in step[-1]["out"] if out[:2] == ["log", "VISP"])
    record[5] = f"{int(record[5], 16) ^ 1:08x}"
    assert compare(scenario, "4.7-dev") == [f"{scenario['name']}: samples"]


# Captures: the whole way from messages to records


def log_of(name: str) -> Path:
    release, _, stem = name.rpartition("/")
    return DATA / release / "logs" / f"{stem}.BIN.xz"


def capture_of(name: str) -> Stream:
    release, _, stem = name.rpartition("/")
    return read_capture(DATA / release / "captures" / f"{stem}.jsonl.gz")


def by_batch(stream: Stream, log: Path, release: str) -> PortReplay:
    make_ahrs = following(read_recorded_states(log)) if log.exists() else never_aligned
    return replay_port(stream, stream.params, baud=stream.baud, make_ahrs=make_ahrs, firmware=PROFILES[release])


def by_vehicle(stream: Stream, log: Path, release: str) -> ReplayOutcome:
    ahrs = ahrs_maker(AhrsChoice(log if log.exists() else None, None, None, 0, 0.0))
    setup = ReplaySetup(ahrs, baud=stream.baud, firmware=PROFILES[release])
    return run_replay(stream, stream.params, setup, keep_messages=True)


def records_of(replay: PortReplay) -> list[list[Any]]:
    outputs = outputs_of(replay.poses, replay.velocities, replay.pose_results, replay.velocity_results)
    return [record for of_sample in outputs for record in of_sample if record[0] == "log"]


def assert_same(stream: Stream, log: Path, release: str) -> None:
    made, whole = by_batch(stream, log, release), by_vehicle(stream, log, release)
    expected = [["log", kind, *map(json_value, values)] for one in whole.messages for kind, values in one.records]
    assert expected
    assert records_of(made) == expected
    assert made.texts == tuple(text for text in whole.texts if text.text.startswith("VisOdom"))


QUICK = [("t265", "4.7-dev")]
OTHERS = [
    *(("dropout", "4.7-dev"), ("flight_mav_extyaw", "4.7-dev"), ("flight_t265", "4.7-dev"), ("mav", "4.6")),
    *(("flight_voxl_reset", "4.7-dev"), ("mav", "4.7-dev"), ("mocap", "4.7-dev"), ("prearm", "4.7-dev")),
    *(("voxl", "4.6"), ("2026-02/mav", "2026-02"), ("2026-02/t265", "2026-02"), ("t265", "2026-02")),
    ("2026-02/mocap_covariance", "2026-02"),
]


@pytest.mark.parametrize(("name", "release"), QUICK)
def test_capture_becomes_the_records_and_texts_of_the_whole_vehicle(name: str, release: str) -> None:
    assert_same(capture_of(name), log_of(name), release)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "release"), OTHERS)
def test_other_captures_become_the_records_and_texts_of_the_whole_vehicle(name: str, release: str) -> None:
    assert_same(capture_of(name), log_of(name), release)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["flight_voxl_reset", "bench_pose_velocity"])
def test_flight_log_becomes_the_records_and_texts_of_the_whole_vehicle(name: str) -> None:
    log = log_of(name)
    assert_same(read_stream(log, 0), log, "4.7-dev")


def test_trajectory_becomes_the_records_of_the_whole_vehicle() -> None:
    stream = read_stream(DATA / "trajectories" / "flight.tum", 6_000_000)
    assert_same(replace(stream, params={"VISO_TYPE": 1.0}), DATA / "no log", "4.7-dev")


@pytest.mark.parametrize("name", ["mav", "2026-02/mav"])
def test_capture_of_the_mav_backend_becomes_the_firmwares_records(name: str) -> None:
    release, _, stem = name.rpartition("/")
    with gzip.open(DATA / release / "captures" / f"{stem}.jsonl.gz", "rt", encoding="utf-8") as file:
        lines = [json.loads(line) for line in file][1:]
    recorded = [record for line in lines for record in line["out"]]
    ours = [record[1:] for record in records_of(by_batch(capture_of(name), log_of(name), release or "4.7-dev"))]
    assert len(ours) == len(recorded) > 0
    for theirs, record in zip(recorded, ours, strict=True):
        # The corrected time depends on when within 2.5 ms the link was read.
        assert abs(theirs.pop(3) - record.pop(3)) <= 3
        assert theirs == record


# Made-up scenarios: the scalar port is the definition


SPECIAL = [float("nan"), float("inf"), float("-inf"), -0.0, 0.0, 1e-42, 3e38, -3e38, 100.0, 1.5]
PARAMS = {
    "TYPE": st.sampled_from([0, 1, 2, 3, 7]),
    "ORIENT": st.sampled_from([0, 2, 4, 24, 25, 38, 50]),
    "SCALE": st.sampled_from(["3f800000", "3f8ccccd", "00000000", "c0000000", "7f800000"]),
    "DELAY_MS": st.integers(-5, 250),
    "VEL_M_NSE": st.sampled_from(["3dcccccd", "3f000000"]),
    "POS_M_NSE": st.sampled_from(["3e4ccccd", "43480000"]),
    "YAW_M_NSE": st.sampled_from(["3e4ccccd", "40400000"]),
    "QUAL_MIN": st.integers(-1, 100),
}
SEEDS = st.integers(0, 2**32 - 1)


def floats(rng: np.random.Generator, count: int, oddity: float) -> list[str]:
    values = rng.normal(scale=3.0, size=count)
    odd = rng.random(count) < oddity
    values[odd] = rng.choice(SPECIAL, int(odd.sum()))
    return [bits_of(value) for value in values.astype(np.float32)]


def segment(rng: np.random.Generator, time_us: int, count: int, period_us: int, oddity: float) -> list[Step]:
    """Return samples of one sender: poses, velocities or both, now and then with another reset counter."""
    counter, quality = int(rng.integers(0, 4)), int(rng.choice([-1, 0, 20, 90]))
    kinds = [["pose"], ["pose_euler"], ["speed"], ["pose", "speed"], ["speed", "pose_euler"]][rng.integers(0, 5)]
    steps: list[Step] = []
    for number in range(count):
        now_us = time_us + number * period_us
        steps.append(["time_us", now_us])
        if rng.random() < 0.02:
            counter = (counter + 1) % 256
        if rng.random() < 0.1:
            quality = int(rng.integers(-1, 101))
        for kind in kinds:
            head = [kind, int(rng.integers(0, 2**63)), int(rng.integers(0, 2**32)), floats(rng, 3, oddity)]
            if kind != "speed":
                attitude = floats(rng, 4 if kind == "pose" else 3, oddity)
                head += [attitude, *floats(rng, 2, oddity)]
            steps.append([*head, counter, quality])
    return steps


@st.composite
def events(draw: st.DrawFn) -> Step:
    kind = draw(st.sampled_from(["ahrs", "request", "position", "param", "status", "check", "delta"]))
    rng = np.random.default_rng(draw(SEEDS))
    if kind == "ahrs":
        flags = ("initialised", "dcm_yaw_initialised", "using_extnav_for_yaw")
        answers: dict[str, Any] = {flag: draw(st.booleans()) for flag in flags}
        quat, pos = (floats(rng, size, 0.1) if draw(st.booleans()) else None for size in (4, 3))
        return ["ahrs", {**answers, "yaw": floats(rng, 1, 0.1)[0], "quat": quat, "pos": pos}]
    if kind == "param":
        name = draw(st.sampled_from(sorted(PARAMS)))
        return ["param", name, draw(PARAMS[name])]
    fixed: dict[str, Step] = {
        "request": ["request_align_yaw"],
        "position": ["align_position", draw(st.booleans()), draw(st.booleans())],
        "status": ["status"],
        "check": ["pre_arm_check"],
        "delta": ["delta", 0, int(rng.integers(0, 2**40)), floats(rng, 3, 0.1), floats(rng, 3, 0.1), "42b40000"],
    }
    return fixed[kind]


Segment = tuple[int, int, int, float]
"""How many moments, microseconds between them, seed, share of odd numbers."""


class Plan(NamedTuple):
    """A made-up scenario, in few words: its steps would be too many to be shown."""

    params: dict[str, Any]
    first_us: int
    begins_aligned: bool
    segments: list[tuple[Segment, list[Step]]]

    def steps(self) -> list[Step]:
        """Return stretches of samples with events between them."""
        ahrs = {"initialised": True, "dcm_yaw_initialised": True, "using_extnav_for_yaw": False, "yaw": "3f000000"}
        steps: list[Step] = [["ahrs", {**ahrs, "quat": None, "pos": None}]] if self.begins_aligned else []
        time_us = self.first_us
        for (count, period_us, seed, oddity), between in self.segments:
            steps += [*segment(np.random.default_rng(seed), time_us, count, period_us, oddity), *between]
            time_us += count * period_us
        return steps


PERIODS = st.sampled_from([0, 700, 33_333, 100_000, 400_000])
SEGMENTS = st.tuples(st.integers(1, 60), PERIODS, SEEDS, st.sampled_from([0.0, 0.01, 0.3]))
PLANS = st.builds(
    Plan,
    st.builds(
        lambda kind, others: {"TYPE": kind, **others},
        st.sampled_from([1, 2, 2, 3]),
        st.fixed_dictionaries({}, optional=PARAMS),
    ),
    st.sampled_from([0, 5_000_000, 30_000_000, 2**32 * 1000 - 700_000]),
    st.booleans(),
    st.lists(st.tuples(SEGMENTS, st.lists(events(), max_size=2)), min_size=1, max_size=5),
)


def state_of(scenario: Scenario) -> dict[str, str]:
    """Return all that the backend remembers; text, as NaN is not equal to itself and has a sign without meaning."""
    driver = scenario._visual_odom._driver
    surroundings = {"_frontend", "_ahrs", "_clock", "_log"}
    return {name: repr(value) for name, value in vars(driver).items() if name not in surroundings} if driver else {}


def assert_bits_of_the_scalar_port(release: str, plan: Plan) -> None:
    library, steps = PROFILES[release].visual_odom, plan.steps()
    batched, scalar = BatchScenario(plan.params, library), Scenario(plan.params, library)
    with np.errstate(all="ignore"):
        made = batched.run_all(steps)
        assert made == expected_of([[*step, {"out": scalar.run(step)}] for step in steps])
    assert state_of(batched) == state_of(scalar)


@pytest.mark.parametrize("release", VECTORS)
@settings(max_examples=6)
@given(plan=PLANS)
def test_made_up_scenario_gives_the_bits_of_the_scalar_port(release: str, plan: Plan) -> None:
    assert_bits_of_the_scalar_port(release, plan)


@pytest.mark.parametrize("release", VECTORS)
@settings(max_examples=6)
@given(plan=PLANS)
def test_made_up_scenario_gives_the_bits_of_the_scalar_port_in_small_chunks(release: str, plan: Plan) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch, "SHORT_ROWS", 0)
        patch.setattr(batch, "CHUNK_ROWS", 7)
        assert_bits_of_the_scalar_port(release, plan)


@pytest.mark.slow
@settings(max_examples=60)
@given(plan=PLANS, sizes=st.sampled_from([(batch.SHORT_ROWS, batch.CHUNK_ROWS), (0, 1), (5, 20)]))
def test_many_made_up_scenarios_give_the_bits_of_the_scalar_port(plan: Plan, sizes: tuple[int, int]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(batch, "SHORT_ROWS", sizes[0])
        patch.setattr(batch, "CHUNK_ROWS", sizes[1])
        assert_bits_of_the_scalar_port("4.7-dev", plan)
