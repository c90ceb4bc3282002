# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The commands of README and docs, typed in their order into a fresh clone by somebody whose home is empty, work."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path

import pytest

from ap_core.native import COMPILED
from tests.interop.programs import Program, running
from tests.places import ROOT
from tools import bootstrap

PAGES = ["README.md", "CONTRIBUTING.md", *sorted(str(path.relative_to(ROOT)) for path in (ROOT / "docs").glob("*.md"))]

# What is in commands that are not run here, and what they would want.
NOT_HERE = {
    r"tools/check|-n 2|test_vectors": "minutes: all tests, this one among them",
    r"tools/site": "half a minute: tests/docs/test_site.py builds it",
    r"tools\.bench|speed\.json|build/fuzz": "minutes to an hour",
    r"pip install": "a download",
    r"MH_01_easy": "a recording of EuRoC",
    r"flight\.mp4|GOPR0042|rtsp:": "a video or a camera",
    r"/dev/tty": "a serial port",
    r"okvis2|vins_mono": "an engine that viso does not build",
    r"seen\.jsonl|aircraft/|detector": "what a detector or a receiver has seen",
    r"--scheduler": "a cluster",
    r"VISO_DELAY_MS=0:\d+:10": "minutes: many flights, as tests/acceptance/test_sweep_delay.py flies them",
}
# What ends with exit code 1, as its page says, and why.
ENDS_WITH_1 = {
    r"doctor (mystream\.(tlog|jsonl)|.*/t265\.jsonl\.gz)": "an error is found",
}
# What runs until Ctrl-C, and what it says once others may begin.
UNTIL_CTRL_C = {
    r"viso serve (?!.*--duration)": "ArduPilot Ready",
    r"viso sitl": "Waiting for connection",
    r"viso faults .* udpin:": "",
    r"viso play --ros2": "waiting for poses",
}
COMPLAINTS = ("Traceback", "install it with", "pip install")
# A command takes seconds; a busy machine may take its time.
COMMAND_S = 300.0


def commands_of(page: Path) -> list[str]:
    """Return the commands of a page's blocks, lines that go on joined."""
    blocks = re.findall(r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    return [line for block in blocks for line in block.replace("\\\n", "").splitlines() if line]


def files_of(page: Path) -> list[tuple[str, str]]:
    """Return names and contents of the files that a page has its reader write, each shown after its name."""
    text = page.read_text(encoding="utf-8")
    return re.findall(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def match(patterns: Iterable[str], command: str) -> str | None:
    """Return the pattern that a command matches."""
    return next((pattern for pattern in patterns if re.search(pattern, command)), None)


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a clone that is set up, with the packages of the environment that runs this."""
    folder = tmp_path_factory.mktemp("fresh") / "viso"
    subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
    venv, here = folder / ".venv", Path(sys.prefix)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", venv], check=True)
    (packages,) = venv.glob("lib/python*/site-packages")
    (packages / "here.pth").write_text(f"{folder}\n{here / packages.relative_to(venv)}\n", encoding="utf-8")
    for program in (here / "bin").iterdir():
        copy = venv / "bin" / program.name
        if not copy.exists() and program.is_file():
            shutil.copy(program, copy)
            first, _, rest = copy.read_bytes().partition(b"\n")
            if first.startswith(b"#!") and b"python" in first:
                copy.write_bytes(b"#!%s\n%s" % (bytes(venv / "bin" / "python"), rest))
    bootstrap.write_stamp(venv, bootstrap.Stamp("dev", bootstrap.digest(folder, "dev"), True))
    compiled = Path(bootstrap.COMPILED_PACKAGE) / COMPILED
    if (ROOT / compiled).is_dir():  # to compile it again takes minutes while other tests run
        shutil.copytree(ROOT / compiled, folder / compiled)
        digest = bootstrap.compile_digest(folder, venv)
        (folder / compiled / "tried").write_text(digest, encoding="utf-8")
    return folder


@pytest.fixture
def shell(clone: Path, tmp_path: Path) -> list[str]:
    """Return how somebody who has just cloned it runs a command; what earlier pages have written is gone."""
    kept = ["--exclude=.venv", "--exclude=__pycache__", "--exclude=_compiled"]
    subprocess.run(["git", "clean", "-dffqx", *kept], cwd=clone, check=True)
    path = f"{clone / '.venv' / 'bin'}:/usr/local/bin:/usr/bin:/bin"
    return ["env", "-i", f"PATH={path}", f"HOME={tmp_path}", "LANG=C.UTF-8", "PYTHONUNBUFFERED=1", "bash", "-c"]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if commands_of(ROOT / page)])
def test_commands_work_in_their_order(page: str, clone: Path, shell: list[str]) -> None:
    for name, content in files_of(clone / page):
        (clone / name).write_text(content, encoding="utf-8")
    with ExitStack() as stack:
        running_on: list[Program] = []
        for command in commands_of(clone / page):
            if match(NOT_HERE, command):
                continue
            program = stack.enter_context(running([*shell, command], clone))
            if endless := match(UNTIL_CTRL_C, command):
                program.until(UNTIL_CTRL_C[endless])
                running_on.append(program)
            else:
                code = program.wait(COMMAND_S)
                assert code == bool(match(ENDS_WITH_1, command)), f"{command}: exit code {code}\n{program.screen()}"
                assert [line for line in program.lines if match(COMPLAINTS, line)] == []
        for program in reversed(running_on):
            assert program.interrupt() == 0, program.screen()
            assert [line for line in program.lines if match(COMPLAINTS, line)] == []


def test_each_exception_is_that_of_a_command() -> None:
    commands = [command for page in PAGES for command in commands_of(ROOT / page)]
    patterns = [*NOT_HERE, *ENDS_WITH_1, *UNTIL_CTRL_C]
    assert [pattern for pattern in patterns if not any(match([pattern], command) for command in commands)] == []
