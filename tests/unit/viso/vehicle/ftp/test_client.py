# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The FTP server as pymavlink's own client sees it, over a connection in memory and in virtual time."""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from pymavlink import mavftp
from pymavlink.mavftp import FtpError as Code

from ap_core.param import ParamGroup, ParamTable
from ap_visualodom.var_info import VAR_INFO
from mav_handlers.transfers.ftp import FtpPeer, FtpReply, FtpServer
from mav_handlers.transfers.param_pck import PackedParam, build_param_pck
from viso.parameters.table import make_groups
from viso.vehicle.ftp import VehicleFiles

SYSTEM, COMPONENT = 255, 190
POLL_S = 0.0025


@dataclass
class Vehicle:
    """A server behind a connection that pymavlink takes for one of its own."""

    server: FtpServer
    now_s: float = 100.0
    lost: Callable[[int], bool] = lambda number: False
    replies: int = 0
    banners: int = 0
    arrived: deque[bytes] = field(default_factory=deque)
    source_system: int = SYSTEM
    source_component: int = COMPONENT

    @property
    def mav(self) -> "Vehicle":
        return self

    def time(self) -> float:
        self.now_s += 1e-5
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s

    @property
    def now_us(self) -> int:
        return round(self.now_s * 1e6)

    def file_transfer_protocol_send(self, network: int, system: int, component: int, payload: Sequence[int]) -> None:
        assert (network, system, component) == (0, 1, 1)
        self._deliver(self.server.handle(bytes(payload), self.now_us, FtpPeer(0, SYSTEM, COMPONENT)))

    def _deliver(self, replies: list[FtpReply]) -> None:
        for reply in replies:
            assert reply.peer == FtpPeer(0, SYSTEM, COMPONENT)
            self.replies += 1
            self.banners += reply.banner
            if not self.lost(self.replies):
                self.arrived.append(reply.payload)

    def recv_match(self, type: Any = None, blocking: bool = False, timeout: float = 0.0) -> Any:
        deadline = self.now_s + timeout
        while not self.arrived and self.now_s < deadline:
            self.now_s += POLL_S
            self._deliver(self.server.continue_burst(self.now_us))
        if not self.arrived:
            return None
        return SimpleNamespace(
            payload=list(self.arrived.popleft()),
            target_system=SYSTEM,
            target_component=COMPONENT,
            get_type=lambda: "FILE_TRANSFER_PROTOCOL",
        )


@pytest.fixture
def params() -> ParamTable:
    """The vehicle's real list, with VISO_TYPE set so that its group shows."""
    table = ParamTable(make_groups(2, ParamGroup("VISO", VAR_INFO)))
    table.set("VISO_TYPE", 2)
    return table


@pytest.fixture
def uploaded() -> list[PackedParam]:
    return []


@pytest.fixture
def vehicle(params: ParamTable, uploaded: list[PackedParam], tmp_path: Path) -> Vehicle:
    logs = tmp_path / "vehicle"
    logs.mkdir()
    for number in range(1, 31):
        (logs / f"{number:08d}.BIN").write_bytes(bytes([number]) * number * 100)
    files = VehicleFiles(
        params, log_directory=logs, system_texts={"uarts.txt": lambda: "UARTV1\n"}, on_upload=uploaded.extend
    )
    return Vehicle(FtpServer(files))


@pytest.fixture
def client(vehicle: Vehicle, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(mavftp, "time", vehicle)
    return mavftp.MAVFTP(vehicle, 1, 1)


def download(client: Any, path: str, timeout: float = 500) -> bytes:
    """Get a file through the client's callback."""
    got: list[bytes] = []
    client.cmd_get([path], callback=lambda file: got.append(file.read()) if file is not None else None)
    result = client.process_ftp_reply("get", timeout=timeout)
    assert result.error_code == Code.Success, result.error_code
    return b"".join(got)


def test_parameters_are_downloaded(client: Any, vehicle: Vehicle, params: ParamTable) -> None:
    data = download(client, "@PARAM/param.pck?withdefaults=1")
    assert data == build_param_pck(params, read_size=80, with_defaults=True)
    decoded = client.ftp_param_decode(data)
    assert [name.decode() for name, _, _ in decoded.params] == [param.name for param in params]
    assert vehicle.banners == 1


def test_parameters_are_saved_to_files(client: Any, params: ParamTable, tmp_path: Path) -> None:
    values, defaults = tmp_path / "values.parm", tmp_path / "defaults.parm"
    client.cmd_getparams([str(values), str(defaults)])
    assert client.process_ftp_reply("getparams", timeout=500).error_code == Code.Success
    assert len(values.read_text().splitlines()) == params.count
    assert "VISO_TYPE,2" in values.read_text().splitlines()
    assert "VISO_TYPE,0" in defaults.read_text().splitlines()


@pytest.mark.parametrize("every", [3, 7, 50])
def test_parameters_arrive_over_a_link_that_loses_packets(
    client: Any, vehicle: Vehicle, params: ParamTable, every: int
) -> None:
    vehicle.lost = lambda number: number % every == 0
    assert download(client, "@PARAM/param.pck") == build_param_pck(params, read_size=80)


@pytest.mark.parametrize("size", [1, 79, 239])
def test_parameters_arrive_at_any_read_size(client: Any, params: ParamTable, size: int) -> None:
    client.ftp_settings.burst_read_size = size
    assert download(client, "@PARAM/param.pck") == build_param_pck(params, read_size=size)


def test_log_is_downloaded(client: Any) -> None:
    assert download(client, "/APM/LOGS/00000030.BIN") == bytes([30]) * 3000


def test_file_of_one_packet_is_downloaded(client: Any) -> None:
    assert download(client, "@SYS/uarts.txt") == b"UARTV1\n"


def test_one_file_follows_another(client: Any) -> None:
    for number in (1, 2, 30):
        assert download(client, f"logs/{number:08d}.BIN") == bytes([number]) * number * 100


def test_directory_is_listed_whole(client: Any) -> None:
    result = client.cmd_list(["/APM/LOGS"])
    assert result.error_code == Code.Success
    entries = [(entry.name, entry.size_b, entry.is_dir) for entry in result.directory_listing]
    assert entries == [(f"{number:08d}.BIN", number * 100, False) for number in range(1, 31)]


def test_root_is_listed(client: Any) -> None:
    names = [(entry.name, entry.is_dir) for entry in client.cmd_list([]).directory_listing]
    assert sorted(names) == [("@SYS", True), ("APM", True), ("logs", True)]


@pytest.mark.parametrize("path", ["/etc/passwd", "../secret", "@PARAM/none"])
def test_absent_file_is_reported(client: Any, path: str) -> None:
    client.cmd_get([path])
    assert client.process_ftp_reply("get", timeout=20).error_code == Code.FileNotFound


@pytest.mark.parametrize("command", ["cmd_rm", "cmd_rmdir", "cmd_mkdir"])
def test_changes_are_refused(client: Any, command: str) -> None:
    result = getattr(client, command)(["/APM/LOGS/00000001.BIN"])
    assert (result.error_code, result.system_error) == (Code.FailErrno, 30)


def test_rename_is_refused(client: Any) -> None:
    assert client.cmd_rename(["logs/00000001.BIN", "logs/other"]).error_code == Code.FailErrno


def test_checksum_is_computed(client: Any) -> None:
    assert client.cmd_crc(["logs/00000030.BIN"]).error_code == Code.Success


def test_parameters_are_uploaded(client: Any, params: ParamTable, uploaded: list[PackedParam], tmp_path: Path) -> None:
    image = bytearray(build_param_pck(params, read_size=1))
    image[4:6] = len(image).to_bytes(2, "little")
    source = tmp_path / "upload.pck"
    source.write_bytes(image)
    client.cmd_put([str(source), "@PARAM/param.pck"])
    assert client.process_ftp_reply("put", timeout=500).error_code == Code.Success
    assert [(one.name, one.value) for one in uploaded] == [(param.name, param.raw) for param in params]


def test_other_uploads_are_refused(client: Any, tmp_path: Path) -> None:
    source = tmp_path / "file"
    source.write_bytes(b"x")
    client.cmd_put([str(source), "/APM/LOGS/00000099.BIN"])
    assert client.process_ftp_reply("put", timeout=20).error_code == Code.FailErrno
    assert not (tmp_path / "vehicle" / "00000099.BIN").exists()
