# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The DataFlash log of a replay against the firmware's own log of the same stream, through three readers."""

import csv
import io
import lzma
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import pytest
from pymavlink.DFReader import DFReader_binary

from tests.places import PARITY
from viso.compare.differences import Difference, Row, row_differences
from viso.compare.tolerances import CAPTURE, CAPTURE_LOG, log_name, tolerances_of

if TYPE_CHECKING:
    from tests.parity.conftest import Replayed

# Benches of the estimator have no capture.
KEPT = sorted(
    f"{path.parts[-3]}/{log_name(path)}"
    for path in PARITY.glob("20*/logs/*.BIN.xz")  # others lack the driver's records, which their captures have
    if (path.parents[1] / "captures" / f"{log_name(path)}.jsonl.gz").exists()
)
"""Logs that have a capture, each after its release."""

TYPES = ("VISP", "VISV", "REPH", "REVH", "RVOH")
Rows = dict[str, list[Row]]
Replays = Callable[[str], "Replayed"]


class Both(NamedTuple):
    """The records of a log of the firmware and of ours, and VISO_TYPE."""

    recorded: Rows
    ours: Rows
    backend: int


@contextmanager
def opened(path: Path) -> Iterator[DFReader_binary]:
    with DFReader_binary(str(path)) as log:
        yield log


def rows_of(path: Path) -> Rows:
    rows: Rows = {kind: [] for kind in TYPES}
    with opened(path) as log:
        while (record := log.recv_match(type=list(TYPES))) is not None:
            values = {name: getattr(record, name) for name in record._fieldnames}
            rows[record.get_type()].append(Row(record.get_type(), values))
    return rows


@cache
def meanings_of(path: Path) -> tuple[dict[str, dict[str, str]], list[tuple[object, ...]]]:
    """Return what a log says of the fields of the types compared here.

    First the unit of each field, multiplier included, by type, as the reader resolves them from FMTU; then what the log
    says of units and multipliers at large, and of these types.
    """
    with opened(path) as log:
        found: set[tuple[object, ...]] = set()
        ids = {fmt.type for fmt in log.formats.values() if fmt.name in TYPES}
        while (record := log.recv_match(type=["UNIT", "MULT", "FMTU"])) is not None:
            if record.get_type() != "FMTU" or record.FmtType in ids:
                found.add(tuple(getattr(record, name) for name in record._fieldnames if name != "TimeUS"))
        formats = [fmt for fmt in log.formats.values() if fmt.name in TYPES]
        units = {fmt.name: {column: fmt.get_unit(column) for column in fmt.columns} for fmt in formats}
        return units, sorted(found, key=repr)


@pytest.fixture(scope="session")
def firmware_log(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that unpacks a log of the firmware by its name."""
    folder = tmp_path_factory.mktemp("firmware")

    @cache
    def unpack(name: str) -> Path:
        release, _, stem = name.partition("/")
        path = folder / f"{release}{stem}.BIN"
        path.write_bytes(lzma.decompress((PARITY / release / "logs" / f"{stem}.BIN.xz").read_bytes()))
        return path

    return unpack


USUAL = {"2025-07/t265"}
"""The usual run takes this one."""


@pytest.fixture(
    scope="session",
    params=[pytest.param(name, marks=() if name in USUAL else pytest.mark.slow) for name in KEPT],
)
def both(request: pytest.FixtureRequest, replayed: Replays, firmware_log: Callable[[str], Path]) -> Both:
    """Return the firmware's records and ours, of one log after the other; the tests of each come together."""
    run = replayed(request.param)
    return Both(rows_of(firmware_log(request.param)), rows_of(run.log), run.recorded.backend)


def differences(theirs: list[Row], ours: list[Row], backend: int) -> list[Difference]:
    found = [] if len(theirs) == len(ours) else [Difference("end", "records", str(len(theirs)), str(len(ours)))]
    tolerances = {**tolerances_of(CAPTURE, backend), **tolerances_of(CAPTURE_LOG, backend)}
    for number, (before, after) in enumerate(zip(theirs, ours, strict=False)):
        found += row_differences(f"record {number}", [before], [after], tolerances, units={})
    return found


@pytest.mark.parametrize("kind", ["VISP", "VISV", "REPH", "REVH"])
def test_records_are_the_firmwares(both: Both, kind: str) -> None:
    assert len(both.ours[kind]) > 400
    assert differences(both.recorded[kind], both.ours[kind], both.backend) == []


def test_state_of_the_camera_changes_as_the_firmwares(both: Both) -> None:
    # The firmware's log goes on after the stream has ended, by one record: the camera is unhealthy then.
    theirs, ours = both.recorded["RVOH"], both.ours["RVOH"]
    assert ours == theirs[: len(ours)]
    assert [row.values["H"] for row in theirs[len(ours) :]] == [0]


@pytest.mark.slow
def test_units_are_the_firmwares(replayed: Replays, firmware_log: Callable[[str], Path]) -> None:
    ours, _ = meanings_of(replayed("2025-07/t265").log)
    assert ours == meanings_of(firmware_log("2025-07/t265"))[0]
    assert [ours["VISP"][name] for name in ("CTimeMS", "PX", "Y", "Q")] == ["ms", "m", "degheading", "%"]


@pytest.mark.slow
def test_unit_and_multiplier_records_are_the_firmwares(replayed: Replays, firmware_log: Callable[[str], Path]) -> None:
    assert meanings_of(replayed("2025-07/t265").log)[1] == meanings_of(firmware_log("2025-07/t265"))[1]


def test_difference_of_a_log_record_is_found(replayed: Replays) -> None:
    ours = rows_of(replayed("2025-07/t265").log)["REPH"]
    changed = [Row("REPH", {**ours[0].values, "PEr": 0.25}), *ours[1:]]
    assert differences(ours, ours, 2) == []
    assert [one.field for one in differences(changed, ours, 2)] == ["REPH.PEr"]
    assert differences(ours[:-1], ours, 2) == [Difference("end", "records", str(len(ours) - 1), str(len(ours)))]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["2025-07/mav", "2025-07/mocap"])
def test_replay_records_follow_log_replay(replayed: Replays, name: str) -> None:
    run = replayed(name)
    rows = rows_of(run.log)
    assert run.recorded.header["params"]["LOG_REPLAY"] == 1
    given = [line for line in run.ours.lines if any(out[0] == "VISP" for out in line["out"])]
    assert len(rows["REPH"]) == len(given)


# Other readers


def test_pymavlink_reads_the_log_to_its_end(replayed: Replays, capfd: pytest.CaptureFixture[str]) -> None:
    with opened(replayed("2025-07/t265").log) as log:
        while log.recv_msg() is not None:
            pass
        assert log.remaining == 0
    assert capfd.readouterr() == ("", "")


def test_log_names_the_vehicle_for_its_modes(replayed: Replays) -> None:
    with opened(replayed("2025-07/t265").log) as log:
        mode = log.recv_match(type="MODE")
        assert mode is not None
        assert log.flightmode == "STABILIZE"


@pytest.mark.slow
def test_mavlogdump_prints_every_pose(replayed: Replays) -> None:
    run = replayed("2025-07/t265")
    script = Path(sys.executable).parent / "mavlogdump.py"
    command = [sys.executable, str(script), "--types", "VISP", "--format", "csv", "--csv_sep", ",", str(run.log)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    header, *rows = csv.reader(io.StringIO(result.stdout))
    poses = [out for line in run.ours.lines for out in line["out"] if out[0] == "VISP"]
    assert header[-3:] == ["Rst", "Ign", "Q"]
    assert len(rows) == len(poses)


@pytest.mark.slow
def test_log_reader_gives_frames_of_visual_odometry(replayed: Replays, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAVLINK20", "1")  # the reader sets it, for good
    run = replayed("2025-07/t265")
    from ardupilot_log_reader.reader import Ardupilot  # with pandas, half a second in every process that collects

    parsed = Ardupilot.parse(str(run.log), types=["VISP", "VISV"])
    poses = [out for line in run.ours.lines for out in line["out"] if out[0] == "VISP"]
    assert len(parsed.dfs["VISP"]) == len(parsed.dfs["VISV"]) == len(poses)
    assert list(parsed.dfs["VISP"]["Q"])[:3] == [pose[-1] for pose in poses[:3]]
