# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso sitl`` and its files; tests/interop/test_sitl.py runs it."""

from pathlib import Path

import pytest

from tests.unit.viso.command_line import Viso


@pytest.mark.parametrize("defaults", ["storage.parm", "other.parm,storage.parm"])
def test_file_that_is_read_is_not_wiped(viso: Viso, defaults: str) -> None:
    for name in ("storage.parm", "other.parm"):
        Path(name).write_text("VISO_TYPE 1\n")
    outcome = viso("sitl", "--defaults", defaults, "--wipe")
    assert outcome.code == 2
    assert "storage.parm: the same file as" in outcome.err
    assert Path("storage.parm").read_text() == "VISO_TYPE 1\n"


@pytest.mark.parametrize(
    ("option", "line"),
    [
        (["--model", "rover"], "--model rover: not a multicopter that flies here"),
        (["--vehicle", "ArduSub"], "--vehicle ArduSub: there is ArduCopter alone"),
        (["--home", "CMAC"], "--home CMAC: not four numbers LAT,LON,ALT,HEADING"),
        (["--serial5", "sim:nmea"], "--serial5 sim:nmea: there is no simulated nmea here; there is sim:vicon"),
        (["--uartB", "x"], "--uartB x: not a device of the forms"),
        (["--speedup", "0"], "--speedup 0.0: not between 0 and 1000"),
    ],
)
def test_what_cannot_be_is_one_line(viso: Viso, option: list[str], line: str) -> None:
    outcome = viso("sitl", *option)
    assert outcome.code == 2
    assert outcome.err.startswith(f"viso: {line}")
    assert outcome.err.count("\n") == 1
