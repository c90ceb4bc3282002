# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The pytest plugin as its users have it: fixtures, marker, golden logs, the page about it and the example's suite."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.places import ROOT
from viso.firmware.releases import PROFILES
from viso.testing import UdpAutopilot

pytest_plugins = ("pytester",)

PAGE = ROOT / "docs" / "pytest.md"
EXAMPLE = ROOT / "docs" / "examples" / "bridge"
WITH_PLUGIN = ("-p", "viso.pytest_plugin", "-p", "no:cacheprovider")

POSE = """
import pytest
from mav_handlers.wire.messages import VISION_POSITION_ESTIMATE

def pose(usec=1, x=0.0):
    return VISION_POSITION_ESTIMATE(usec, x, y=0.0, z=0.0, roll=0.0, pitch=0.0, yaw=0.0)
"""


@pytest.fixture(autouse=True)
def no_other_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


def run(pytester: pytest.Pytester, tests: str, *args: str) -> pytest.RunResult:
    """Return what pytest says of a module of tests, which have ``pose``."""
    pytester.makepyfile(POSE + tests)
    return pytester.runpytest_inprocess(*WITH_PLUGIN, "--strict-markers", *args)


@pytest.mark.slow
def test_each_test_has_a_vehicle_of_its_own(pytester: pytest.Pytester) -> None:
    tests = """
@pytest.mark.parametrize("turn", [1, 2])
def test_turn(extnav_autopilot, turn):
    assert extnav_autopilot.now_us == 6_500_000
    assert extnav_autopilot.verdicts == extnav_autopilot.records == extnav_autopilot.received == []
    extnav_autopilot.send(pose())
    extnav_autopilot.assert_accepted(count=1)
"""
    run(pytester, tests).assert_outcomes(passed=2)


@pytest.mark.slow
def test_nearest_marker_wins_parameter_by_parameter(pytester: pytest.Pytester) -> None:
    tests = """
pytestmark = pytest.mark.extnav_autopilot(preset="voxl", imu="bench", params={"VISO_DELAY_MS": 20, "VISO_SCALE": 2})

@pytest.mark.extnav_autopilot(params={"VISO_DELAY_MS": 30})
def test_params(extnav_autopilot):
    names = "VISO_TYPE", "VISO_DELAY_MS", "VISO_SCALE"
    assert [extnav_autopilot.params[name] for name in names] == [3, 30, 2]
    assert type(extnav_autopilot.vehicle.ahrs.source).__name__ == "BenchSource"
"""
    run(pytester, tests).assert_outcomes(passed=1)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("'voxl'", "*the marker takes params, preset, imu, firmware, vision, home, by name, and not 'voxl'"),
        ("param={}", "*by name, and not param"),
        ("params=3", "*extnav_autopilot: params is 3, not a mapping of names to numbers"),
        ("params={'VISO_TYP': 1}", "*extnav_autopilot: params: * unknown parameter VISO_TYP"),
        ("preset='vox'", "*extnav_autopilot: preset 'vox': no such preset; there are *voxl"),
        ("imu='floats'", "*extnav_autopilot: imu floats: no such source; there are bench, *"),
        ("firmware='3.2'", f"*extnav_autopilot: firmware '3.2': no such firmware; there are {', '.join(PROFILES)}"),
    ],
)
def test_marker_that_cannot_be_used_is_told_in_one_line(pytester: pytest.Pytester, arguments: str, told: str) -> None:
    result = run(pytester, f"@pytest.mark.extnav_autopilot({arguments})\ndef test_it(extnav_autopilot): pass")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines([told])
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*pytest_plugin.py*")
    result.stdout.no_fnmatch_line("*another exception*")


@pytest.mark.slow
def test_failed_claim_points_at_the_test_and_tells_what_came(pytester: pytest.Pytester) -> None:
    tests = """
def test_it(extnav_autopilot):
    extnav_autopilot.send(pose())
    extnav_autopilot.assert_dropped()
"""
    result = run(pytester, tests)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [
            ">       extnav_autopilot.assert_dropped()",
            "E       AssertionError: expected at least one message dropped, found 0; what came:",
            "E           1 VISION_POSITION_ESTIMATE accepted, consumed: handed to the EKF (first at 6.500 s)",
        ]
    )
    result.stdout.no_fnmatch_line("*claims.py*")


GOLDEN = """
def test_it(extnav_autopilot):
    extnav_autopilot.send(pose(x={}))
    extnav_autopilot.assert_golden("flight")
"""


@pytest.mark.slow
def test_misuse_points_at_the_test(pytester: pytest.Pytester) -> None:
    tests = "def test_it(extnav_autopilot):\n    extnav_autopilot.assert_dropped('typing_mistake')"
    result = run(pytester, tests)
    result.stdout.fnmatch_lines(["E*ValueError: reason 'typing_mistake': no such rule*", "test_*.py:*: ValueError"])
    result.stdout.no_fnmatch_line("*claims.py*")


@pytest.mark.slow
def test_missing_golden_log_fails_with_the_hint(pytester: pytest.Pytester) -> None:
    result = run(pytester, GOLDEN.format(1.5))
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        ["*AssertionError: there is no golden log */golden/flight.jsonl; pytest --update-golden*"]
    )
    assert not (pytester.path / "golden").exists()


@pytest.mark.slow
def test_golden_log_is_written_and_then_held_against(pytester: pytest.Pytester) -> None:
    run(pytester, GOLDEN.format(1.5), "--update-golden").assert_outcomes(passed=1)
    (line,) = (pytester.path / "golden" / "flight.jsonl").read_text().splitlines()
    assert line.startswith('{"record": "VISP", "TimeUS": 6500000, "RTimeUS": 1, "CTimeMS": 6500, "PX": 1.5, ')
    run(pytester, GOLDEN.format(1.5)).assert_outcomes(passed=1)
    result = run(pytester, GOLDEN.format(2.5))
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(['E*-{*"PX": 1.5,*', 'E*+{*"PX": 2.5,*'])


@pytest.mark.slow
def test_same_tests_pass_over_udp_and_leave_the_same_golden_log(pytester: pytest.Pytester) -> None:
    tests = """
import socket
from mav_handlers.wire.codec import Codec

@pytest.mark.parametrize("way", ["in_process", "socket"])
def test_it(request, way):
    autopilot = request.getfixturevalue("extnav_autopilot" if way == "in_process" else "extnav_autopilot_udp")
    codec = Codec(1, 197)
    with socket.socket(type=socket.SOCK_DGRAM) as port:
        for count in range(5):
            frame = codec.encode(pose(1000 * count))
            autopilot.write(frame) if way == "in_process" else port.sendto(frame, autopilot.address)
            autopilot.advance(ms=7)
    autopilot.assert_accepted(count=5)
    autopilot.assert_golden("flight", records=("VISP", "XKF1", "MSG"))
"""
    run(pytester, tests, "--update-golden", "-k", "in_process").assert_outcomes(passed=1, deselected=1)
    run(pytester, tests).assert_outcomes(passed=2)


@pytest.mark.slow
def test_plugin_imports_nothing_heavy_before_a_fixture_is_used(tmp_path: Path) -> None:
    test = tmp_path / "test_it.py"
    test.write_text(
        "import sys\ndef test_it():\n    assert not {'numpy', 'pymavlink', 'viso.testing'} & set(sys.modules)\n"
    )
    done = subprocess.run([sys.executable, "-m", "pytest", *WITH_PLUGIN, "-q", test], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_help_tells_option_and_marker(pytester: pytest.Pytester) -> None:
    pytester.runpytest_inprocess(*WITH_PLUGIN, "--help").stdout.fnmatch_lines(["*--update-golden*"])
    markers = pytester.runpytest_inprocess(*WITH_PLUGIN, "--markers")
    markers.stdout.fnmatch_lines(
        ["@pytest.mark.extnav_autopilot(params=..., preset=..., imu=..., firmware=..., vision=..., home=...): *"]
    )


# The page and the example


@pytest.mark.slow
def test_code_of_the_page_passes(pytester: pytest.Pytester) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    for number, block in enumerate(blocks):
        pytester.makepyfile(**{f"test_block_{number}": block})
    pytester.runpytest_inprocess(*WITH_PLUGIN, "--strict-markers").assert_outcomes(passed=len(blocks))


def test_page_names_everything_there_is() -> None:
    text = PAGE.read_text(encoding="utf-8")
    names = ["vehicle", "params", *(name for name in dir(UdpAutopilot) if not name.startswith("_"))]
    assert [name for name in names if not re.search(rf"[`.]{name}\b", text)] == []


@pytest.mark.slow
def test_tests_of_the_example_pass_as_its_user_runs_them(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTEST_ADDOPTS": " ".join(WITH_PLUGIN), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-W", "error", "-m", "pytest", "-ra"]
    done = subprocess.run(command, cwd=EXAMPLE, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    names = re.findall(r"^def (test_\w+)", (EXAMPLE / "tests" / "test_kestrel_bridge.py").read_text(), re.MULTILINE)
    assert f"= {2 * len(names) - 1} passed in " in done.stdout  # the last one is about the socket alone
