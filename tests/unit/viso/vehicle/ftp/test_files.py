# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the vehicle shows by FTP, and that it shows nothing else."""

import errno
import os
import struct
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.param import ParamGroup, ParamInfo, ParamTable, ParamType
from mav_handlers.transfers.ftp_ports import Entry, Failure, ReadableFile
from mav_handlers.transfers.param_pck import PackedParam, PckQuery, build_param_pck
from viso.vehicle.ftp import DiskFile, ParamPckFile, VehicleFiles

ABSENT = Failure(errno.ENOENT)
INVALID = Failure(errno.EINVAL)
READ_ONLY = Failure(errno.EROFS)


@pytest.fixture
def params() -> ParamTable:
    rows = [ParamInfo(f"AB_{index:03}", ParamType.INT16, index, "") for index in range(50)]
    return ParamTable([ParamGroup("", rows)])


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    """A directory of logs with things in it and around it that are nobody's business."""
    (tmp_path / "secret.txt").write_bytes(b"secret")
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "00000001.BIN").write_bytes(b"first log")
    (logs / "00000002.BIN").write_bytes(b"second log!")
    (logs / "LASTLOG.TXT").write_bytes(b"2\r\n")
    (logs / "notes.txt").write_bytes(b"secret")
    (logs / "00000003.BIN").mkdir()
    (logs / "00000004.BIN").symlink_to(tmp_path / "secret.txt")
    (logs / "00000005.BIN").symlink_to("00000001.BIN")
    os.mkfifo(logs / "00000006.BIN")
    return logs


@pytest.fixture
def files(params: ParamTable, directory: Path) -> VehicleFiles:
    texts = {"uarts.txt": lambda: "UARTV1\n", "tasks.txt": lambda: ""}
    return VehicleFiles(params, log_directory=directory, system_texts=texts)


def opened(answer: ReadableFile | Failure) -> ReadableFile:
    assert not isinstance(answer, Failure)
    return answer


def contents(answer: ReadableFile | Failure, read_size: int = 80) -> bytes:
    """Read a file to its end and close it."""
    file = opened(answer)
    data = b""
    while True:
        piece = file.read(len(data), read_size)
        assert not isinstance(piece, Failure)
        if not piece:
            file.close()
            return data
        data += piece


class TestListing:
    def test_root_leads_to_logs_and_reports(self, files: VehicleFiles) -> None:
        expected = [Entry("APM"), Entry("logs"), Entry("@SYS")]
        assert files.list_directory("/") == expected
        assert files.list_directory("") == expected

    def test_folder_of_a_card_is_two_deep(self, files: VehicleFiles) -> None:
        assert files.list_directory("/APM") == [Entry("LOGS")]

    def test_folders_may_share_a_parent(self, params: ParamTable, directory: Path) -> None:
        files = VehicleFiles(params, log_directory=directory, log_folders=["a/x", "a/y"])
        assert files.list_directory("/") == [Entry("a")]
        assert files.list_directory("/a") == [Entry("x"), Entry("y")]

    @pytest.mark.parametrize("path", ["logs", "/logs", "APM/LOGS", "/APM/LOGS"])
    def test_logs_are_listed_and_nothing_beside_them(self, files: VehicleFiles, path: str) -> None:
        assert files.list_directory(path) == [
            Entry("00000001.BIN", 9),
            Entry("00000002.BIN", 11),
            Entry("LASTLOG.TXT", 3),
        ]

    @pytest.mark.parametrize("path", ["@SYS", "/@SYS", "@SYS/"])
    def test_reports_have_a_size_that_is_none(self, files: VehicleFiles, path: str) -> None:
        assert files.list_directory(path) == [Entry("uarts.txt", 100_000), Entry("tasks.txt", 100_000)]

    @pytest.mark.parametrize(
        "path",
        ["@PARAM", "@SYS/uarts.txt", "logs/00000001.BIN", "//", "//logs", "logs/..", "..", ".", "/etc", "@ROMFS"],
    )
    def test_nothing_else_can_be_listed(self, files: VehicleFiles, path: str) -> None:
        assert files.list_directory(path) == ABSENT

    def test_directory_that_is_not_there_lists_nothing(self, params: ParamTable, tmp_path: Path) -> None:
        assert VehicleFiles(params, log_directory=tmp_path / "none").list_directory("logs") == []

    def test_vehicle_without_logs_and_reports_has_an_empty_root(self, params: ParamTable) -> None:
        files = VehicleFiles(params)
        assert files.list_directory("/") == []
        assert files.list_directory("logs") == ABSENT
        assert files.open_read("logs/00000001.BIN") == ABSENT


class TestLogs:
    @pytest.mark.parametrize("path", ["logs/00000002.BIN", "/APM/LOGS/00000002.BIN"])
    def test_log_is_read(self, files: VehicleFiles, path: str) -> None:
        assert opened(files.open_read(path)).size == 11
        assert contents(files.open_read(path), 4) == b"second log!"

    def test_log_that_grows_is_read_to_its_present_end(self, files: VehicleFiles, directory: Path) -> None:
        file = opened(files.open_read("logs/00000001.BIN"))
        with (directory / "00000001.BIN").open("ab") as log:
            log.write(b"+")
        assert file.read(0, 20) == b"first log+"
        file.close()

    def test_offset_beyond_2_gib_is_invalid(self, files: VehicleFiles) -> None:
        file = opened(files.open_read("logs/00000001.BIN"))
        assert file.read(0x7FFFFFFF, 1) == b""
        assert file.read(0x80000000, 1) == INVALID
        file.close()

    @pytest.mark.parametrize(
        "name",
        [
            "00000003.BIN",  # a directory
            "00000004.BIN",  # a link to the outside
            "00000005.BIN",  # a link to a log
            "00000006.BIN",  # a pipe that nobody writes to
            "00000007.BIN",
            "notes.txt",
            "../secret.txt",
            "00000001.BIN/",
            "00000001.BIN\n",
            "00000001.BIN\0",
            "00000001.bin",
            "./00000001.BIN",
            "\u0661" * 8 + ".BIN",
            "\udcff",
            "0" * 300,
            "",
        ],
    )
    def test_nothing_else_in_the_directory_is_read(self, files: VehicleFiles, name: str) -> None:
        assert files.open_read(f"logs/{name}") == ABSENT

    @pytest.mark.parametrize(
        "path",
        [
            "",
            "/",
            "logs",
            "00000001.BIN",
            "logs//00000001.BIN",
            "//logs/00000001.BIN",
            "/etc/passwd",
            "/dev/zero",
            "APM",
        ],
    )
    def test_nothing_outside_is_read(self, files: VehicleFiles, path: str) -> None:
        assert files.open_read(path) == ABSENT

    def test_path_on_disk_is_not_a_path_here(self, files: VehicleFiles, directory: Path) -> None:
        assert files.open_read(str(directory / "00000001.BIN")) == ABSENT

    def test_unreadable_directory_carries_its_errno(self, params: ParamTable, directory: Path) -> None:
        files = VehicleFiles(params, log_directory=directory / "00000001.BIN")
        assert files.open_read("logs/00000001.BIN") == Failure(errno.ENOTDIR)
        assert files.list_directory("logs") == []

    def test_failing_read_carries_its_errno(self, directory: Path) -> None:
        descriptor = os.open(directory, os.O_RDONLY)
        file = DiskFile(descriptor, 0)
        assert file.read(0, 1) == Failure(errno.EISDIR)
        file.close()


class TestReports:
    def test_report_is_made_when_opened(self, files: VehicleFiles) -> None:
        assert opened(files.open_read("@SYS/uarts.txt")).size == 100_000
        assert contents(files.open_read("/@SYS/uarts.txt"), 3) == b"UARTV1\n"

    @pytest.mark.parametrize("path", ["@SYS/tasks.txt", "@SYS/memory.txt", "@SYS", "@SYS/", "@SYS/../uarts.txt"])
    def test_empty_or_unknown_report_is_absent(self, files: VehicleFiles, path: str) -> None:
        assert files.open_read(path) == ABSENT


class TestParamPck:
    def test_file_is_the_list_for_the_size_of_the_first_read(self, files: VehicleFiles, params: ParamTable) -> None:
        file = opened(files.open_read("@PARAM/param.pck"))
        assert file.size == 600
        assert contents(file, 80) == build_param_pck(params, read_size=80)

    def test_query_selects(self, files: VehicleFiles, params: ParamTable) -> None:
        data = contents(files.open_read("/@PARAM/param.pck?start=3&count=2&withdefaults=1"))
        assert data == build_param_pck(params, read_size=80, start=3, count=2, with_defaults=True)

    def test_other_size_of_reads_fails(self, files: VehicleFiles) -> None:
        file = opened(files.open_read("@PARAM/param.pck"))
        file.read(0, 80)
        assert file.read(80, 79) == INVALID
        assert file.read(80, 0) == INVALID
        assert isinstance(file.read(80, 80), bytes)

    def test_read_of_nothing_fixes_no_size(self, files: VehicleFiles) -> None:
        file = opened(files.open_read("@PARAM/param.pck"))
        assert file.read(0, 0) == b""
        assert isinstance(file.read(0, 80), bytes)

    def test_start_beyond_the_end_fails_when_read(self, files: VehicleFiles) -> None:
        assert opened(files.open_read("@PARAM/param.pck?start=50")).read(0, 80) == INVALID

    def test_values_are_those_of_the_first_read(self, params: ParamTable) -> None:
        file = ParamPckFile(params, PckQuery())
        before = build_param_pck(params, read_size=80)
        file.read(0, 80)
        params.set("AB_040", 1234)
        assert contents(file, 80) == before

    def test_query_out_of_range_is_invalid(self, files: VehicleFiles) -> None:
        assert files.open_read("@PARAM/param.pck?start=65535") == INVALID

    @pytest.mark.parametrize("path", ["@PARAM", "@PARAM/", "@PARAM/param.pckx", "@PARAM/x/param.pck", "@PARAM/a.parm"])
    def test_there_is_no_other_file(self, files: VehicleFiles, path: str) -> None:
        assert files.open_read(path) == ABSENT


class TestWriting:
    @pytest.mark.parametrize("path", ["logs/00000001.BIN", "@SYS/uarts.txt", "@PARAM/param.pck", "new", "/"])
    def test_everything_is_read_only(self, files: VehicleFiles, directory: Path, path: str) -> None:
        assert files.open_write(path, create=True) == READ_ONLY
        assert files.open_write(path, create=False) == READ_ONLY
        assert files.remove(path) == READ_ONLY
        assert files.make_directory(path) == READ_ONLY
        assert files.rename(path, "new") == READ_ONLY
        assert (directory / "00000001.BIN").read_bytes() == b"first log"


class TestUpload:
    @pytest.fixture
    def taken(self) -> list[PackedParam]:
        return []

    @pytest.fixture
    def writable(self, params: ParamTable, taken: list[PackedParam]) -> VehicleFiles:
        def take(uploaded: Sequence[PackedParam]) -> None:
            taken.extend(uploaded)

        return VehicleFiles(params, on_upload=take)

    def test_parameters_are_handed_over_when_the_file_is_closed(
        self, writable: VehicleFiles, taken: list[PackedParam]
    ) -> None:
        file = writable.open_write("@PARAM/param.pck", create=True)
        assert not isinstance(file, Failure)
        data = struct.pack("<HHH", 0x671B, 1, 15) + b"\x01\x50AB_000\x07"
        assert file.write(6, data[6:]) is None
        assert file.write(0, data[:6]) is None
        assert taken == []
        file.close()
        assert taken == [PackedParam("AB_000", ParamType.INT8, 7)]

    def test_malformed_upload_is_dropped(self, writable: VehicleFiles, taken: list[PackedParam]) -> None:
        file = writable.open_write("/@PARAM/param.pck", create=False)
        assert not isinstance(file, Failure)
        file.write(0, b"nonsense")
        file.close()
        assert taken == []

    def test_upload_cannot_grow_without_bound(self, writable: VehicleFiles) -> None:
        file = writable.open_write("@PARAM/param.pck", create=True)
        assert not isinstance(file, Failure)
        assert file.write(0xFFFFFFFF, b"x") == Failure(errno.ENOSPC)
        assert file.write(65534, b"x") is None
        assert file.write(65535, b"x") == Failure(errno.ENOSPC)

    @pytest.mark.parametrize(
        ("path", "failure"),
        [("@PARAM/other", ABSENT), ("@PARAM/param.pck?count=65535", INVALID), ("logs/00000001.BIN", READ_ONLY)],
    )
    def test_nothing_else_can_be_written(self, writable: VehicleFiles, path: str, failure: Failure) -> None:
        assert writable.open_write(path, create=True) == failure


PIECES = st.sampled_from(
    [
        "/",
        "..",
        ".",
        "logs",
        "APM",
        "LOGS",
        "@SYS",
        "@PARAM",
        "param.pck",
        "?start=",
        "00000004.BIN",
        "secret.txt",
        "\0",
    ]
)


@given(st.one_of(st.text(max_size=300), st.lists(PIECES, max_size=12).map("".join)))
def test_no_path_leads_to_a_secret(tmp_path_factory: pytest.TempPathFactory, path: str) -> None:
    outside = tmp_path_factory.getbasetemp() / "guarded"
    logs = outside / "logs"
    if not logs.exists():
        logs.mkdir(parents=True)
        (outside / "secret.txt").write_bytes(b"secret")
        (logs / "secret.txt").write_bytes(b"secret")
        (logs / "00000004.BIN").symlink_to(outside / "secret.txt")
    params = ParamTable([ParamGroup("", [ParamInfo("A", ParamType.INT8, 0, "")])])
    files = VehicleFiles(params, log_directory=logs, system_texts={"uarts.txt": lambda: "report"})
    answer = files.open_read(path)
    assert isinstance(answer, Failure) or b"secret" not in contents(answer)
    listed = files.list_directory(path)
    assert isinstance(listed, Failure) or "secret.txt" not in [entry.name for entry in listed]
