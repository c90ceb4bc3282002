# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What starting costs is what it imports: a command brings nothing heavy along that it does not use."""

import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import Final

import pytest

from mav_handlers.wire.codec import Codec
from tools.bench import odometry_at
from viso.cli import COMMANDS

HEAVY: Final = {
    *("scipy", "matplotlib", "cv2", "gtsam", "pandas", "pyarrow", "distributed", "filterpy", "rosbags"),
    *("starlette", "uvicorn", "pymap3d", "pyModeS", "evo", "asyncio"),
    *("pymavlink.mavutil", "pymavlink.dialects.v10.all", "pymavlink.dialects.v20.development", "rich.progress"),
    "quaternion",
}
COMMAND_MODULES: Final = {f"viso.commands.{name}" for name in COMMANDS}
EACH: Final = """
import sys
from viso.cli import COMMANDS, command_function
for name in COMMANDS:
    before = set(sys.modules)
    command_function(name)
    print(name, *set(sys.modules) - before)
"""
PROGRAM: Final = """
import sys
from viso.cli import main
sys.argv = {arguments}
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""


def program(*arguments: str) -> list[str]:
    """Return the command line of ``viso`` that at its end lists, in the last line of errors, what it has imported."""
    return [sys.executable, "-c", PROGRAM.format(arguments=["viso", *arguments])]


def listed(errors: str) -> set[str]:
    return set(errors.splitlines()[-1].split())


@pytest.mark.slow
def test_commands_import_nothing_heavy() -> None:
    command = [sys.executable, "-c", EACH]
    lines = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, timeout=60).stdout.splitlines()
    brought = {name: HEAVY.intersection(modules) for name, *modules in map(str.split, lines)}
    assert brought == {name: set() for name in COMMANDS}


def test_package_alone_imports_nothing_heavy() -> None:
    done = subprocess.run(
        [sys.executable, "-c", "import sys, viso; print(*sys.modules)"],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
        timeout=60,
    )
    assert {"numpy", *HEAVY}.intersection(done.stdout.split()) == set()


@pytest.mark.slow
def test_help_of_a_command_imports_no_other_command() -> None:
    done = subprocess.run(program("serve", "-h"), capture_output=True, text=True, check=True, timeout=60)
    assert listed(done.stderr) & COMMAND_MODULES == {"viso.commands.serve"}


def test_the_list_of_commands_imports_none_of_them() -> None:
    done = subprocess.run(program("-h"), capture_output=True, text=True, check=True, timeout=60)
    modules = listed(done.stderr)
    assert "viso.cli" in modules
    assert modules & {*COMMAND_MODULES, "numpy", "pymavlink", "rich"} == set()


@pytest.mark.slow
def test_serving_imports_nothing_heavy_up_to_an_accepted_message(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        listening.settimeout(60)
        link = f"tcp:127.0.0.1:{listening.getsockname()[1]}"
        command = program("serve", "--master", link, "--param", "VISO_TYPE=1", "--verdicts", "json")
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path
        ) as process:
            assert process.stdout is not None
            with closing(listening.accept()[0]) as connection:
                connection.sendall(Codec(1, 197).encode(odometry_at(1_000_000)))
                assert any('"outcome": "accepted"' in line for line in process.stdout)
                process.terminate()
                modules = listed(process.communicate(timeout=60)[1])
    assert "ekf_stub.core.core" in modules
    assert modules & HEAVY == set()
