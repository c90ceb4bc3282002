# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""SweepRequest: TOML files, the command line over them, and the plans that follow."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.places import RECORDED
from tests.unit.viso.sweep.conftest import CAPTURE
from viso.errors import InputError
from viso.sweep import planning
from viso.sweep.planning import make_plan
from viso.sweep.request import SweepRequest, read_request
from viso.vehicle.sensors.flight import Basis

WHOLE = """
streams = ["mav.jsonl.gz", "other/t265.jsonl.gz"]
faults = ["none", "loss.yaml"]
seeds = [1, 2]
firmware = ["4.6", "2025-07"]
imu = "log:logs/{name}.BIN.xz"
reference = "logs/{name}.BIN.xz"
baud = 0
until = 20
[set]
VISO_DELAY_MS = "0:20:10"
EK3_POS_I_GATE = [300, 500]
[param]
VISO_SCALE = 1.5
"""

Toml = Callable[[str], Path]


@pytest.fixture
def toml(tmp_path: Path) -> Toml:
    def write(text: str) -> Path:
        path = tmp_path / "sweep.toml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def whole(tmp_path: Path, toml: Toml, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a file that says it all; nobody asks what the motion of its logs is made of."""
    monkeypatch.setattr(planning, "read_flight", lambda _log: SimpleNamespace(basis=Basis.REPLAY))
    (tmp_path / "other").mkdir()
    (tmp_path / "mav.jsonl.gz").symlink_to(CAPTURE)
    (tmp_path / "other" / "t265.jsonl.gz").symlink_to(CAPTURE.parent / "t265.jsonl.gz")
    (tmp_path / "loss.yaml").write_text("faults: [{kind: loss}]")
    (tmp_path / "logs").mkdir()
    for name, there in (("mav", "prearm"), ("t265", "t265")):
        (tmp_path / "logs" / f"{name}.BIN.xz").symlink_to(RECORDED / "logs" / f"{there}.BIN.xz")
    return toml(WHOLE)


def test_toml_file_says_it_all_with_paths_beside_it(whole: Path, tmp_path: Path) -> None:
    plan = make_plan(read_request(whole))
    assert plan.size == 2 * 2 * 2 * 2 * 3 * 2
    assert [one.name for one in plan.recordings] == ["mav", "t265"]
    assert [one.imu for one in plan.recordings] == [f"log:{tmp_path}/logs/{name}.BIN.xz" for name in ("mav", "t265")]
    assert plan.recordings[1].reference == f"{tmp_path}/logs/t265.BIN.xz"
    assert [len(one.others) for one in plan.recordings] == [1, 1]
    assert [one.name for one in plan.faults] == ["none", f"{tmp_path}/loss.yaml"]
    assert (plan.seeds, plan.firmware, plan.baud, plan.until_s) == ((1, 2), ("4.6", "2025-07"), 0, 20.0)
    assert [axis.values for axis in plan.axes] == [(0.0, 10.0, 20.0), (300.0, 500.0)]
    assert {name: dict(values) for name, values in plan.settings.items()} == {
        "4.6": {"VISO_SCALE": 1.5},
        "2025-07": {"VISO_SCALE": 1.5},
    }


def test_command_line_wins_over_the_file(whole: Path) -> None:
    given = SweepRequest(set=["VISO_DELAY_MS=5"], seeds="7", baud=57600, param=["VISO_SCALE=2"])
    plan = make_plan(given.over(read_request(whole)))
    values = {axis.name: axis.values for axis in plan.axes}
    assert values == {"VISO_DELAY_MS": (5.0,), "EK3_POS_I_GATE": (300.0, 500.0)}
    assert (plan.seeds, plan.baud, plan.settings["4.6"]["VISO_SCALE"]) == ((7,), 57600, 2.0)


@pytest.mark.parametrize(("text", "complaint"), [
    ("streams = 3", "streams: not a list of texts"),
    ("streams = []", "streams: not a list of texts"),
    ("stream = 'a'", "stream: no such key here; there are "),
    ("set = 3", "set: not a table of names and values"),
    ("[set]\nA = true", "set: neither a text such as '0:200:10', nor a number, nor a list of numbers"),
    ("[set]\nA = ['x']", "set: neither a text"),
    ("baud = 1.5", "baud: not a whole number"),
    ("until = 'late'", "until: not a number"),
    ("imu = 3", "imu: not a text"),
    ("strict = 1", "strict: not true or false"),
    ("baud = " + "[" * 5000, "nested too deeply"),
    ("baud = " + "9" * 5000, "not TOML: Exceeds the limit"),
    ("baud = x", "not TOML: Invalid value (at line 1, column 8)"),
])  # fmt: skip
def test_toml_that_cannot_be_used_is_one_line(toml: Toml, text: str, complaint: str) -> None:
    path = toml(text)
    with pytest.raises(InputError) as error:
        read_request(path)
    assert str(error.value).startswith(f"{path}: {complaint}")
