# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""No command writes over what it reads, whatever that is called; and what it cannot finish leaves what was there."""

import itertools
import json
import lzma
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import pytest

from mav_handlers.wire.messages import HEARTBEAT
from tests.little_space import space_for
from tests.places import RECORDED
from tests.unit.viso.command_line import Viso, failed_with
from viso.commands import vectors as vectors_command
from viso.replay import vectors as replay_vectors

ALIVE: Final = HEARTBEAT(6, 8, 0, 0, 4, 3)
PRECIOUS: Final = b"precious"
KEPT: Final = [
    ("replay X --log Y", "STREAM X"),
    ("replay X --records Y", "STREAM X"),
    ("replay poses.tum --ahrs X --log Y", "--ahrs X"),
    ("replay poses.tum --imu log:X --log Y", "--imu log:X"),
    ("replay poses.tum --defaults other.parm --defaults X --log Y", "--defaults X"),
    ("play X -o Y", "TRAJECTORY X"),
    ("doctor X --sarif Y", "FILE_OR_LINK X"),
    ("replay poses.tum --imu script:X --records Y", "--imu script:X"),
    ("replay poses.txt --times X --log Y", "--times X"),
    ("play poses.txt --times X -o Y", "--times X"),
    ("doctor X --junit Y", "FILE_OR_LINK X"),
    ("doctor poses.tum --attitude X --sarif Y", "--attitude X"),
    ("vio X --events Y", "SOURCE X"),
    ("vio flight.mp4 --imu X --save-trajectory Y", "--imu X"),
    ("vio synthetic --config X --plot Y", "--config X"),
    ("vio synthetic --truth X --save-trajectory Y", "--truth X"),
    ("landmarks other.jsonl X --csv Y", "INPUT X"),
    ("landmarks X --records Y --follow", "INPUT X"),
    ("landmarks --demo --camera X --plot Y", "--camera X"),
    ("faults X -o Y --fault kind:nan", "A X"),
    ("faults flight.tlog --timeline X -o Y", "--timeline X"),
    ("report X -o Y", "LOG X"),
    ("report X --mcap Y", "LOG X"),
    ("ekf X -o Y", "LOG.BIN X"),
    ("vectors other.jsonl X -o Y", "FILE X"),
    ("sweep X -o Y", "STREAM X"),
    ("serve --defaults X --verdicts-file Y", "--defaults X"),
    ("serve --defaults X --storage Y", "--defaults X"),
    ("serve --ahrs X --verdicts-file Y", "--ahrs X"),
]
"""Command lines that read X and write Y, and how the input is called in the error."""

LINKED: Final = 7  # of them are tried by other names of X too

NAMES: Final[dict[str, Callable[[Path, Path], None]]] = {
    "itself": lambda _x, _y: None,
    "symbolic link": lambda x, y: y.symlink_to(x),
    "hard link": lambda x, y: y.hardlink_to(x),
    "link to the output": lambda x, y: x.rename(y).with_name(x.name).symlink_to(y),
}


@pytest.mark.parametrize(
    ("line", "name", "how"),
    [
        *((*kept, "itself") for kept in KEPT),
        *((*kept, how) for kept in KEPT[:LINKED] for how in NAMES if how != "itself"),
    ],
)
def test_input_is_not_written_over(viso: Viso, line: str, name: str, how: str) -> None:
    x, y = Path("x.tlog"), Path("x.tlog" if how == "itself" else "y.tlog")
    x.write_bytes(PRECIOUS)
    NAMES[how](x, y)
    there = sorted(os.listdir())
    words = line.replace("X", str(x)).replace("Y", str(y)).split()
    option = words[words.index(str(y), 1 + words.index(name.split()[-1].replace("X", str(x)))) - 1]
    option = "--output" if option == "-o" else option
    told = f"{option} {y}: the same file as {name.replace('X', str(x))}, which is read"
    assert failed_with(viso(*words), told)
    assert x.read_bytes() == PRECIOUS
    assert sorted(os.listdir()) == there


def test_store_of_parameters_beside_the_logs_is_no_parameter_file(serve: Viso) -> None:
    Path("logs").mkdir()
    Path("logs", "storage.parm").write_text("# mine\nVISO_TYPE 1\n")
    line = "logs/storage.parm: the same file as --defaults logs/storage.parm, which is read"
    assert failed_with(serve("--defaults", "logs/storage.parm"), line)


def test_page_of_a_log_is_not_the_log(viso: Viso) -> None:
    Path("flight.html").write_bytes(PRECIOUS)
    line = "flight.html: the same file as LOG flight.html, which is read"
    assert failed_with(viso("report", "flight.html"), line)


@pytest.mark.parametrize("with_file", [False, True])
def test_stream_is_not_a_table_of_its_sweep(viso: Viso, with_file: bool) -> None:
    Path("results.csv").write_text("".join(f"{t}000000000,0,0,0,1,0,0,0\n" for t in (1, 2)))
    before = Path("results.csv").read_bytes()
    Path("sweep.toml").write_text('streams = ["results.csv"]\n')
    stream = "sweep.toml" if with_file else "results.csv"
    outcome = viso("sweep", stream, "-o", ".", "--set", "VISO_SCALE=1,2")
    assert outcome.code == 2
    assert outcome.err.splitlines()[-1].startswith("viso: results.csv: the same file as ")
    assert Path("results.csv").read_bytes() == before
    assert sorted(os.listdir()) == ["results.csv", "sweep.toml"]


# What is not finished


@pytest.fixture
def calls(tmp_path: Path) -> Path:
    """Return calls of the firmware's maths whose outputs take 60 kB."""
    path = tmp_path / "calls.jsonl"
    path.write_text("".join(f'["wrap_360", ["{0x43B48000 + number:08x}"]]\n' for number in range(1500)))
    return path


@pytest.fixture
def halfway(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Callable[[], None]], None]]:
    """Return a function that has something happen while ``viso vectors`` is at work."""

    def let(happen: Callable[[], None]) -> None:
        numbers = itertools.count()

        def recompute(*args: object) -> object:
            if next(numbers) == 1000:
                happen()
            return replay_vectors.recompute(*args)  # type: ignore[arg-type]

        monkeypatch.setattr(vectors_command, "recompute", recompute)

    before = signal.getsignal(signal.SIGTERM)
    yield let
    signal.signal(signal.SIGTERM, before)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("before", [None, PRECIOUS])
def test_interrupted_command_leaves_what_was_there(
    viso: Viso, calls: Path, halfway: Callable[[Callable[[], None]], None], number: int, code: int, before: bytes | None
) -> None:
    if before is not None:
        Path("out.jsonl").write_bytes(before)
    halfway(lambda: signal.raise_signal(number))
    assert viso("vectors", calls, "-o", "out.jsonl").code == code
    assert (Path("out.jsonl").read_bytes() if Path("out.jsonl").exists() else None) == before
    assert sorted(os.listdir()) == ["calls.jsonl"] + ["out.jsonl"] * (before is not None)


def test_error_halfway_leaves_what_was_there(viso: Viso, calls: Path) -> None:
    Path("out.jsonl").write_bytes(PRECIOUS)
    with calls.open("a") as file:
        file.write("[]\n")
    assert viso("vectors", calls, "-o", "out.jsonl").code == 2
    assert Path("out.jsonl").read_bytes() == PRECIOUS
    assert sorted(os.listdir()) == ["calls.jsonl", "out.jsonl"]


FULL: Final = """
import resource, sys
sys.dont_write_bytecode = True  # which it would cut short
from viso import cli
from viso.files import outputs

def full(*args, draft=outputs._Draft):
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # not before: logs are unpacked into files
    return draft(*args)

outputs._Draft = full
cli.main()
"""
FILLING: Final = [
    "vectors calls.jsonl -o OUT",
    "play long.tum -o OUT.tlog",
    "faults short.jsonl -o OUT.tlog --timeline t.yaml",
    "replay short.jsonl --log OUT.BIN",
    "replay short.jsonl --records OUT.jsonl",
    "doctor short.jsonl --sarif OUT.sarif",
    "report flight.BIN -o OUT.html",
    "ekf flight.BIN --until 6 --no-compare -o OUT.BIN",
    "landmarks --demo --frame spherical --csv OUT.csv",
    "landmarks --demo --frame spherical --until 3 --plot OUT.png",
    "vio synthetic --until 2 --plot OUT.png",
]


@pytest.mark.slow
@pytest.mark.parametrize("line", FILLING)
def test_full_disk_leaves_what_was_there(viso: Viso, calls: Path, tmp_path: Path, line: str) -> None:
    Path("flight.BIN").write_bytes(lzma.decompress((RECORDED / "logs" / "bench_no_yaw_source.BIN.xz").read_bytes()))
    capture = RECORDED / "captures" / "mav.jsonl.gz"
    shutil.copy(capture, "short.jsonl")  # compressed or not is told by the content
    Path("long.tum").write_text("".join(f"{t / 20} 0 0 -1 0 0 0 1\n" for t in range(1000)))
    Path("t.yaml").write_text("faults: [{kind: delay}]")
    words = line.split()
    (out,) = (Path(word) for word in words if word.startswith("OUT"))
    out.write_bytes(PRECIOUS)
    there = sorted(os.listdir())
    child = [sys.executable, "-P", "-c", FULL, *words]
    done = subprocess.run(child, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1] == f"viso: {out}: File too large"
    assert out.read_bytes() == PRECIOUS
    assert sorted(os.listdir()) == there


def test_full_disk_is_one_line(viso: Viso, calls: Path) -> None:
    Path("out.jsonl").write_bytes(PRECIOUS)
    with space_for(20_000):
        assert failed_with(viso("vectors", calls, "-o", "out.jsonl"), "out.jsonl: File too large")
    assert Path("out.jsonl").read_bytes() == PRECIOUS
    assert sorted(os.listdir()) == ["calls.jsonl", "out.jsonl"]


# What happens only once


def test_verdicts_keep_those_of_before(serve: Viso) -> None:
    Path("v.jsonl").write_bytes(PRECIOUS)
    assert serve("--verdicts-file", "v.jsonl", "--json", sent=(ALIVE,)).code == 0
    assert json.loads(Path("v.jsonl").read_bytes())["type"] == "HEARTBEAT"
    assert Path("v.jsonl~").read_bytes() == PRECIOUS
