# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The example packages, installed beside us, add a strategy, a kind of stream, a check of the doctor and a link."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from ap_core import plugins
from mav_handlers import VISION_SPEED_ESTIMATE, Codec
from mav_handlers.links import LinkError, open_link
from tests.places import ROOT
from tests.unit.viso.companion.vio.strategy_rig import (
    Ticks,
    make_calibration,
    make_frame,
    make_logger,
    output_of,
    still_window,
)
from viso import InputError, Stream, StreamMessage, read_stream
from viso.companion import VioConfig, build_vio_strategy
from viso.doctor import all_checks, diagnose, gather
from viso.doctor.checks import transport

EXTENDING = ROOT / "docs" / "extending.md"
EXAMPLES = sorted((ROOT / "docs" / "examples" / "plugins").iterdir())


def install(folder: Path, into: Path) -> None:
    """Leave in a folder what pip would tell about a package."""
    project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = into / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir(parents=True)
    lines = [f"Name: {project['name']}", f"Version: {project['version']}"]
    (info / "METADATA").write_text("\n".join(["Metadata-Version: 2.1", *lines, ""]), encoding="utf-8")
    points = [
        line
        for group, rows in project["entry-points"].items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in rows.items()))
    ]
    (info / "entry_points.txt").write_text("\n".join([*points, ""]), encoding="utf-8")


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plugins, "_read", {})
    for folder in EXAMPLES:
        install(folder, tmp_path / "site")
        monkeypatch.syspath_prepend(folder)
    monkeypatch.syspath_prepend(tmp_path / "site")


@pytest.mark.usefixtures("installed")
def test_strategy_is_built_by_its_name() -> None:
    logger, _ = make_logger()
    strategy = build_vio_strategy(VioConfig(strategy="standstill"), make_calibration(), Ticks(), logger)
    frame = make_frame(0)
    window = still_window(frame.capture_timestamp - 50_000_000, frame.capture_timestamp)
    assert not output_of(strategy.process(frame, window)).relative_pose_T.t.any()


@pytest.mark.usefixtures("installed")
def test_stream_is_read_by_its_ending(tmp_path: Path) -> None:
    path = tmp_path / "walk.positions"
    path.write_text("0.5 1 2 -3\n1.0 1.5 2 -3\n", encoding="utf-8")
    assert [message.arrival_us for message in read_stream(path, 30_000_000).messages] == [30_500_000, 31_000_000]
    path.write_text("0.5 1 2\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"walk\.positions: not enough values"):
        read_stream(path, 0)


@pytest.mark.slow
@pytest.mark.usefixtures("installed")
def test_check_of_the_doctor_finds(tmp_path: Path) -> None:
    camera = Codec(1, 197)
    speeds = [(30_000_000 + 50_000 * count, 1.0 if count < 5 else 4.0) for count in range(10)]
    frames = [(time_us, camera.encode(VISION_SPEED_ESTIMATE(time_us, x, 0.0, 0.0))) for time_us, x in speeds]
    stream = Stream("made", tuple(StreamMessage(time_us, frame) for time_us, frame in frames))
    (finding,) = [one for one in diagnose(gather(stream), all_checks()) if one.code == "WALK-01"]
    assert finding.evidence == "5 messages report more than 3 m/s"
    assert finding.message_numbers == (6, 7, 8, 9, 10)


def test_check_on_the_page_finds() -> None:
    (block,) = re.findall(r"```python\n(.*?)```", EXTENDING.read_text(encoding="utf-8"), re.DOTALL)
    names = dict(vars(transport))
    exec(block, names)
    sender = Codec(7, 1)
    frames = [sender.encode(VISION_SPEED_ESTIMATE(time_us, 0.0, 0.0, 0.0)) for time_us in range(0, 1_000_000, 50_000)]
    stream = Stream("made", tuple(StreamMessage(50_000 * count, frame) for count, frame in enumerate(frames)))
    (finding,) = diagnose(gather(stream, is_tried=False), [names["autopilot_component"]])
    assert (finding.code, finding.evidence) == ("XN1-11", "20 messages came from component 1")


@pytest.mark.usefixtures("installed")
def test_link_is_opened_by_its_scheme() -> None:
    link = open_link("loopback:")
    link.send(b"heard")
    assert link.receive() == b"heard"
    link.close()
    with pytest.raises(LinkError, match=r"known forms: .*, loopback:$"):
        open_link("carrier-pigeon:")


def test_without_them_nobody_knows_their_names() -> None:
    with pytest.raises(LinkError, match="no link has this form"):
        open_link("loopback:")


@pytest.mark.parametrize("folder", EXAMPLES, ids=lambda folder: folder.name)
def test_example_is_one_small_module(folder: Path) -> None:
    (module,) = folder.glob("*.py")
    code = [line for line in module.read_text(encoding="utf-8").splitlines() if line.strip() and line[0] != "#"]
    assert len(code) <= 50


@pytest.mark.slow
def test_broken_plugin_is_one_line_on_standard_error_and_the_rest_works(tmp_path: Path) -> None:
    install(EXAMPLES[0], tmp_path)  # without its module
    program = "from viso.doctor import all_checks\nfrom mav_handlers.links.table import all_links\n"
    program += (
        "from viso.streams.stream_kinds import all_kinds\nfrom viso.companion.vio.registry import all_strategies\n"
    )
    program += "print(all(map(len, (all_checks(), all_links(), all_kinds(), all_strategies()))))"
    done = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n{program}"],
        capture_output=True,
        text=True,
        check=True,
    )
    reason = "ModuleNotFoundError: No module named 'viso_loopback'"
    line = f"plug-in loopback (viso.links) of viso-loopback 1.0 left out: {reason}"
    assert (done.stdout, done.stderr) == ("True\n", f"{line}\n")
