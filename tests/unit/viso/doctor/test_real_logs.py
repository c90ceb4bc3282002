# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the doctor finds in recordings that other projects published, finding by finding, and why each is true."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import pytest

from tests.places import DATA
from viso.doctor import CHECKS, Finding, Severity, diagnose, gather
from viso.streams.stream_kinds import TrajectoryOptions, read_whole_stream

REAL = DATA / "real"
LEAD_US = 7_000_000


@dataclass(frozen=True, slots=True)
class Told:
    """A finding, by what its evidence has to say, and why that is so."""

    severity: Severity
    evidence: str
    why: str


@dataclass(frozen=True, slots=True)
class Recording:
    """A file, and all that is to be found in it.

    Attributes:
        name: of the file.
        told: findings by code.
        topic: of a bag.
    """

    name: str
    told: Mapping[str, Told] = field(default_factory=dict)
    topic: str | None = None


def note(evidence: str, why: str) -> Told:
    return Told(Severity.NOTE, evidence, why)


def warning(evidence: str, why: str) -> Told:
    return Told(Severity.WARNING, evidence, why)


def error(evidence: str, why: str) -> Told:
    return Told(Severity.ERROR, evidence, why)


_OF_TEXT: Mapping[str, Told] = {
    "XN5-08": note("have a covariance of zeros or NaN", "TUM's format has none, so ATT_POS_MOCAP carries zeros"),
    "XN7-16": note("these were not given", "a trajectory holds no parameters"),
    "XN9-01": note("by absolute aiding from 7.055 s on", "positions come from the first message on"),
}

RECORDINGS = (
    Recording(
        "rpg_vio_mono_V2_03_start.tum",
        {
            "XN2-13": warning("106 deg from level all the time", "the poses are of the IMU, whose x axis points up"),
            "XN6-02": warning(
                "once, by up to 175 deg", "the first 2 poses are identity; the third looks down by 74 deg"
            ),
            **_OF_TEXT,
        },
    ),
    Recording(
        "rpg_vio_stereo_MH_01_start.tum",
        {
            "XN2-13": warning("111 deg from level all the time", "the poses are of the IMU, whose x axis points up"),
            "XN6-02": warning("once, by up to 169 deg", "the first pose is identity; the second looks down by 73 deg"),
            **_OF_TEXT,
        },
    ),
    Recording(
        "vicon2gt_vinsmono_magistrale1_end.tum",
        {
            **_OF_TEXT,
            "XN9-04": note(
                "accelerates harder than the model's vehicle can follow",
                "it is shaken by hand: yaw swings at up to 500 deg/s, and nothing jumps",
            ),
        },
    ),
    Recording(
        "evo_georeferenced_start.tum",
        {
            "XN4-01": error("0.741 messages per second, 1300 ms apart", "its times are 1.3 s apart"),
            "XN5-19": error("in steps of 0.5 m", "UTM: 5.4e6 m north, where binary32 has 24 bits"),
            **_OF_TEXT,
        },
    ),
    Recording(
        "evo_fr2_desk_ORB_kf_mono.tum",
        {
            "XN4-01": error(
                "1.71 messages per second, in bursts or with gaps",
                "key frames alone, half of them more than 0.37 s apart",
            ),
            **_OF_TEXT,
        },
    ),
    Recording(
        "evo_nav2_turtlebot.mcap",
        {
            "XN3-05": warning("0.68 % too slow", "stamps of simulated time, which ran slower than the computer's"),
            "XN4-04": warning("the longest of 2157 ms", "the bag holds nothing of these two seconds"),
            "XN5-08": note("zeros or NaN", "the robot's odometry fills its covariance with zeros"),
            "XN7-16": note("these were not given", "a bag holds no parameters"),
            "XN9-01": note("by absolute aiding", "poses and velocities agree"),
        },
        "/odom",
    ),
)


def findings_in(recording: Recording) -> list[Finding]:
    options = TrajectoryOptions(topic=recording.topic)
    stream = read_whole_stream(REAL / recording.name, LEAD_US, options)
    return diagnose(gather(stream, filter_s=120.0), CHECKS)


@pytest.mark.slow
@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda recording: recording.name)
def test_all_that_is_found_is_true_and_nothing_is_missing(recording: Recording) -> None:
    if recording.topic is not None:
        pytest.importorskip("rosbags", reason="rosbags is not installed")
    findings = findings_in(recording)
    assert [finding.code for finding in findings] == list(recording.told)
    for finding, told in zip(findings, recording.told.values(), strict=True):
        assert finding.severity is told.severity, told.why
        assert told.evidence in finding.evidence, told.why


def test_every_recording_is_judged() -> None:
    judged = {recording.name for recording in RECORDINGS}
    assert {path.name for path in REAL.iterdir() if path.suffix in (".tum", ".mcap")} == judged
