# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources of inertial data go by the names that the command line knows."""

import lzma
from pathlib import Path

import pytest

from ekf_stub.inputs.sensors import SensorSource
from tests.places import RECORDED
from viso.errors import InputError
from viso.vehicle.sensors.flown.source import RecordedSource
from viso.vehicle.sensors.hil import HilSource
from viso.vehicle.sensors.inertial_sources import IMU_HELP, IMU_SOURCES, read_source
from viso.vehicle.sensors.moving import FlyingSource
from viso.vehicle.sensors.script.script import ScriptSource
from viso.vehicle.sensors.source import ImuOptions
from viso.vehicle.sensors.standing import BenchSource
from viso.vehicle.sensors.stream.follow import FollowSource

FIRMWARE_LOG = RECORDED / "logs" / "prearm.BIN.xz"
BEGINNING = 300_000
KINDS = {
    "bench": BenchSource,
    "script": ScriptSource,
    "follow": FollowSource,
    "fly": FlyingSource,
    "hil": HilSource,
    "log": RecordedSource,
}


@pytest.mark.parametrize("name", IMU_SOURCES)
def test_source_is_made_anew_for_every_boot(name: str, tmp_path: Path) -> None:
    log = tmp_path / "short.BIN"
    with lzma.open(FIRMWARE_LOG) as whole:
        log.write_bytes(whole.read(BEGINNING))
    arguments = {"script": ":square", "log": f":{log}"}
    make, options = read_source(name + arguments.get(name, "")), ImuOptions(heading_rad=0.25)
    first: SensorSource = make(options)
    assert type(first) is KINDS[name]
    assert make(options) is not first
    assert first.yaw_rad() == 0.25


@pytest.mark.parametrize("name", IMU_SOURCES)
def test_help_names_every_source(name: str) -> None:
    argument = IMU_SOURCES[name].argument
    assert f"{name}:{argument}: " in IMU_HELP if argument else f"{name}: " in IMU_HELP


def test_argument_may_hold_a_colon(tmp_path: Path) -> None:
    path = tmp_path / "C:square.toml"
    path.write_text('[[leg]]\nshape = "hover"\nduration_s = 1\n')
    assert type(read_source(f"script:{path}")(ImuOptions())) is ScriptSource


@pytest.mark.parametrize(("text", "error"), [
    ("", "no such source; there are bench, script, follow, fly, hil, log"),
    ("Bench", "no such source; there are bench, script, follow, fly, hil, log"),
    ("script", "not script:FILE"),
    ("log:", "not log:FILE"),
    ("bench:", "bench takes nothing behind it"),
    ("hil:14550", "hil takes nothing behind it"),
])  # fmt: skip
def test_unusable_name_is_refused(text: str, error: str) -> None:
    with pytest.raises(InputError) as raised:
        read_source(text)
    assert str(raised.value) == f"--imu {text}: {error}"


def test_unusable_file_is_refused_before_the_vehicle_boots(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_source(f"log:{tmp_path / 'none.BIN'}")
