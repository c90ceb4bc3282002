# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""One stream as two releases of the firmware: what is told to differ."""

import gzip
import json
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.places import DATA, RECORDED

if TYPE_CHECKING:
    from tests.unit.viso.command_line import Viso

CAPTURES = RECORDED / "captures"


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the first 170 messages of a capture, of which some have a covariance."""
    path = tmp_path_factory.mktemp("short") / "mocap.jsonl.gz"
    with gzip.open(CAPTURES / "mocap.jsonl.gz", "rt", encoding="utf-8") as file:
        lines = file.readlines()[:171]
    with gzip.open(path, "wt", encoding="utf-8") as file:
        file.writelines(lines)
    return path


@pytest.mark.slow
def test_errors_that_differ_are_told_with_both_values(viso: "Viso", short: Path) -> None:
    outcome = viso("replay", str(short), "--versus", "2026-02", "--json")
    assert outcome.code == 0
    told = json.loads(outcome.out)
    assert told["firmware"] == {"before": "2025-07", "after": "2026-02"}
    [change] = told["differs"]["errors"]
    assert (change["type"], change["first"]) == ("GLOBAL_VISION_POSITION_ESTIMATE", 152)
    assert change["messages"] == told["differs"]["changed_records"] > 1
    assert change["before"] == pytest.approx([1.517, 1.130], abs=1e-3)
    assert change["after"] == pytest.approx([1.625, 1.380], abs=1e-3)
    assert told["differs"]["innovations"] == []  # they are told with the filter alone
    assert told["firmware_reason"].startswith("the recording says ArduCopter 4.7.0-dev")
    assert "error from a covariance" in [row["what"] for row in told["known"]]


@pytest.mark.slow
def test_difference_is_told_to_people(viso: "Viso", short: Path) -> None:
    outcome = viso("replay", str(short), "--firmware", "2026-02", "--versus", "4.6")
    assert outcome.code == 0
    assert outcome.out.splitlines()[0] == "before: firmware 2026-02; after: firmware 4.6"
    assert "Errors of poses that differ" in outcome.out
    assert "judged as 2026-02: it was asked for; the recording says ArduCopter 4.7.0-dev" in outcome.out
    *_, known = outcome.out.partition("known to differ between 2026-02 and 4.6:\n")
    assert (
        "- MAVLink, covariance of ATT_POS_MOCAP: read, as that of ODOMETRY -> not read (ab0bd00d92, 2026-02-05)"
        in known
    )


@pytest.mark.slow
def test_what_the_filter_makes_of_other_errors_is_told(viso: "Viso", short: Path) -> None:
    args = [str(short), "--versus", "2026-02", "--ekf"]
    told = json.loads(viso("replay", *args, "--json").out)["differs"]["innovations"]
    kinds = {row["kind"]: row for row in told}
    assert {"pose", "yaw"} <= kinds.keys()
    assert kinds["pose"]["unit"] == "m"
    assert kinds["pose"]["model"] is True
    assert kinds["pose"]["rms_before"] != kinds["pose"]["rms_after"]
    assert "Innovations that differ" in viso("replay", *args).out


@pytest.mark.slow
def test_releases_that_agree_differ_in_nothing(viso: "Viso", short: Path) -> None:
    outcome = viso("replay", str(short), "--firmware", "4.6", "--versus", "2025-07")
    assert "Errors of poses" not in outcome.out
    assert "no verdict differs" in outcome.out
    assert "records" not in outcome.out
    assert "known to differ between 4.6 and 2025-07:\n- MAVLink, " in outcome.out
    assert "\n- EKF3, " in outcome.out


@pytest.mark.slow
def test_parameters_of_a_file_hold_in_both(viso: "Viso", short: Path, tmp_path: Path) -> None:
    path = tmp_path / "old.parm"
    path.write_text("ARMING_CHECK 0\nSYSID_THISMAV 7\nVISO_QUAL_MIN 5\n")
    args = ["--firmware", "4.6", "--versus", "2026-02", "--defaults", str(path), "--json"]
    told = json.loads(viso("replay", str(short), *args).out)
    rules = [{row["reason"] for row in told[side]["verdicts"]} for side in ("before", "after")]
    assert rules[0] == rules[1]
    assert "quality is below VISO_QUAL_MIN" in rules[0]


def test_two_comparisons_at_once_are_refused(viso: "Viso", short: Path) -> None:
    outcome = viso("replay", str(short), "--set", "VISO_QUAL_MIN=1", "--versus", "4.6")
    assert (outcome.code, outcome.err) == (2, "viso: --set and --versus: one comparison at a time\n")


def test_unknown_release_is_refused(viso: "Viso", short: Path) -> None:
    outcome = viso("replay", str(short), "--versus", "3.2")
    assert outcome.code == 2
    assert "--versus 3.2: no such profile; there are 4.6, 2025-07, 2026-02, 4.7" in outcome.err


@pytest.mark.parametrize(("after", "differs"), [("4.7", True), pytest.param("4.6", False, marks=pytest.mark.slow)])
def test_flow_that_releases_take_otherwise_is_told(viso: "Viso", after: str, differs: bool) -> None:
    path = str(DATA / "flow" / "rates_beside_units.tlog.gz")
    outcome = viso("replay", path, "--firmware", "2025-07", "--versus", after)
    assert outcome.code == 0
    line = "flow: 349 of 350 measurements differ: 1.49 rad/s before, 0.373 after (root mean square)"
    assert (line in outcome.out.splitlines()) is differs
