# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Plans of requested sweeps, and what cannot be requested."""

import lzma
import math
from pathlib import Path
from typing import Any

import pytest

from tests.places import DATA, PARITY, RECORDED
from tests.unit.viso.sweep.conftest import CAPTURE, MakePlan
from viso.errors import InputError
from viso.streams.stream_kinds import TrajectoryOptions
from viso.sweep.plan import Faults, Sampling


@pytest.mark.parametrize(("wanted", "complaint"), [
    ({"streams": []}, "no recorded stream is given"),
    ({"streams": [Path("a.jpg")]}, "a.jpg: by its ending no recorded stream"),
    ({"streams": [Path("missing.tlog")]}, "missing.tlog: No such file or directory"),
    ({"streams": [CAPTURE, CAPTURE]}, f"{CAPTURE}: given twice"),
    ({"set": []}, "nothing is changed: "),
    ({"set": ["VISO_DELAY_MS=0:9"]}, "--set VISO_DELAY_MS=0:9: a grid needs a step"),
    ({"set": ["faults.1.probability=0,1"]}, "--set faults.1.probability: there is no timeline"),
    ({"sample": "dice"}, "--sample dice: there are random, latin"),
    ({"sample": "latin"}, "--sample latin: --points sets how many"),
    ({"sample": "latin", "points": 0}, "--points 0: not 1 or more"),
    ({"sample": "latin", "points": 1, "sample_seed": -1}, "--sample-seed -1: not 0 or more"),
    ({"points": 3}, "--points: goes with --sample"),
    ({"seeds": "1.5"}, "--seeds 1.5: 1.5 is no whole number from 0"),
    ({"seeds": "-1"}, "--seeds -1: -1 is no whole number from 0"),
    ({"firmware": ["3.2"]}, "--firmware 3.2: no such profile"),
    ({"baud": -1}, "--baud -1: not 0 or more"),
    ({"lead": -1.0}, "--lead -1.0: not a time"),
    ({"until": 0.0}, "--until 0: not a time"),
    ({"heading": math.nan}, "--heading nan: not an angle"),
    ({"imu_error": ["x=1"]}, "--imu-error 'x=1': no such error"),
    ({"imu": "log:missing.BIN"}, "missing.BIN: No such file or directory"),
    ({"ahrs": "a.BIN", "imu": "bench"}, "--ahrs and --imu: a vehicle that follows a log has no sensors"),
    ({"reference": "missing.tum"}, "missing.tum: No such file or directory"),
    ({"faults": ["missing.yaml"]}, "missing.yaml: No such file or directory"),
    ({"preset": "none"}, "--preset none: no such preset"),
    ({"param": ["A=1"]}, "--param 'A=1': unknown parameter A"),
    ({"rate": 30.0}, f"{CAPTURE}: --as, --format, --topic, --times, --axes and --rate are for trajectories"),
])  # fmt: skip
def test_wish_that_cannot_be_had_is_one_line(
    make_plan_of: MakePlan, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, wanted: dict[str, Any], complaint: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as error:
        make_plan_of(**wanted)
    assert str(error.value).removeprefix(f"{tmp_path}/").startswith(complaint)


def test_timeline_is_checked_with_the_values_that_it_will_have(make_plan_of: MakePlan, tmp_path: Path) -> None:
    (tmp_path / "loss.yaml").write_text("faults: [{kind: loss}]")
    with pytest.raises(InputError, match=r"entry 1 \(loss\): probability: 1.5 is not within 0 to 1"):
        make_plan_of(faults=[str(tmp_path / "loss.yaml")], set=["faults.1.probability=0:1.5:0.5"])
    (tmp_path / "bad.yaml").write_text("faults: [{kind: lost}]")
    with pytest.raises(InputError, match="'lost' is unknown"):
        make_plan_of(faults=[str(tmp_path / "bad.yaml")])


@pytest.mark.slow
def test_flight_log_with_sensors_is_replayed_with_them(make_plan_of: MakePlan, tmp_path: Path) -> None:
    log = tmp_path / "short.BIN"
    with lzma.open(RECORDED / "logs" / "prearm.BIN.xz") as whole:
        log.write_bytes(whole.read(300_000))
    assert make_plan_of(streams=[log]).recordings[0].imu == f"log:{log}"
    assert make_plan_of(streams=[log], imu="follow").recordings[0].imu == "follow"
    assert make_plan_of().recordings[0].imu == "follow"


@pytest.mark.slow
def test_capture_has_the_sensors_of_the_log_of_its_name(make_plan_of: MakePlan, tmp_path: Path) -> None:
    capture = CAPTURE.parent / "prearm.jsonl.gz"
    assert make_plan_of(streams=[capture]).recordings[0].imu == f"log:{RECORDED}/logs/prearm.BIN.xz"
    beside = tmp_path / "prearm.jsonl.gz"
    beside.symlink_to(capture)
    assert make_plan_of(streams=[beside]).recordings[0].imu == "follow"
    (tmp_path / "prearm.BIN.xz").symlink_to(RECORDED / "logs" / "prearm.BIN.xz")
    assert make_plan_of(streams=[beside]).recordings[0].imu == f"log:{tmp_path}/prearm.BIN.xz"


def test_example_scripts_need_no_file(make_plan_of: MakePlan) -> None:
    (recorded,) = make_plan_of(imu="script:figure_eight").recordings
    assert (recorded.imu, recorded.others) == ("script:figure_eight", ())


def test_draws_faults_and_trajectories_are_as_asked(make_plan_of: MakePlan) -> None:
    wanted: dict[str, Any] = {"set": ["VISO_SCALE=0.9:1.1"], "sample": "latin", "points": 5, "seeds": "1:3"}
    plan = make_plan_of(streams=[DATA / "trajectories" / "flight.tum"], axes="NED/FRD", rate=10.0, **wanted)
    assert (plan.sampling, plan.seeds, plan.size) == (Sampling("latin", 5), (1, 2, 3), 15)
    assert plan.trajectory == TrajectoryOptions(axes="NED/FRD", rate_hz=10.0)
    assert plan.faults == (Faults(),)


def test_streams_of_one_name_are_told_apart_by_their_paths(make_plan_of: MakePlan) -> None:
    other = PARITY / "2026-02" / "captures" / "mav.jsonl.gz"
    assert [one.name for one in make_plan_of(streams=[CAPTURE, other]).recordings] == [str(CAPTURE), str(other)]
