# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The file of the signing key."""

import logging
import os
import stat
from pathlib import Path

import pytest

from ap_core.param import ParamTable
from mav_handlers.signing import SigningKey
from mav_handlers.transfers.ftp_ports import Failure
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT, SETUP_SIGNING, Message
from viso.files.key_store import FileKeyStore, KeyStoreError
from viso.running.virtual_time import Scheduler
from viso.vehicle.ftp import LOG_FOLDERS, VehicleFiles
from viso.vehicle.vehicle import Vehicle, VehicleConfig

KEY = SigningKey(timestamp=123_456_789, secret_key=bytes(range(32)))
OTHER = SigningKey(timestamp=5, secret_key=bytes(32))


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "keys" / "signing.key"


def no_space(*_args: object) -> None:
    raise OSError(28, "No space left on device")


def test_no_file_is_no_key(path: Path) -> None:
    assert FileKeyStore(path).load() == b""
    assert not path.parent.exists()


def test_key_outlives_the_store(path: Path) -> None:
    assert FileKeyStore(path).save(KEY.to_bytes())
    assert SigningKey.from_bytes(FileKeyStore(path).load()) == KEY


def test_saved_key_is_there_at_once(path: Path) -> None:
    store = FileKeyStore(path)
    store.save(KEY.to_bytes())
    store.save(OTHER.to_bytes())
    assert store.load() == OTHER.to_bytes() == path.read_bytes()


@pytest.mark.parametrize("umask", [0o000, 0o022])
def test_nobody_else_can_read_the_file(path: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        FileKeyStore(path).save(KEY.to_bytes())
    finally:
        os.umask(before)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


def test_file_that_others_could_read_is_closed_to_them_by_the_next_save(path: Path) -> None:
    path.parent.mkdir()
    path.write_bytes(KEY.to_bytes())
    path.chmod(0o644)
    FileKeyStore(path).save(OTHER.to_bytes())
    assert stat.S_IMODE(path.stat().st_mode) == 0o600


@pytest.mark.parametrize("data", [b"", b"key", KEY.to_bytes()[:-1], KEY.to_bytes() + b"\0", bytes(48)])
def test_damaged_file_is_one_line_that_names_it(path: Path, data: bytes) -> None:
    path.parent.mkdir()
    path.write_bytes(data)
    with pytest.raises(KeyStoreError) as error:
        FileKeyStore(path)
    assert str(error.value) == f"{path}: not a signing key; without the file there is no signing"
    assert path.read_bytes() == data


def test_file_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(KeyStoreError) as error:
        FileKeyStore(tmp_path)
    assert str(error.value) == f"{tmp_path}: Is a directory"


def test_failed_save_leaves_the_old_key(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = FileKeyStore(path)
    store.save(KEY.to_bytes())
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", no_space)
        assert not store.save(OTHER.to_bytes())
    assert store.load() == path.read_bytes() == KEY.to_bytes()
    assert store.failure == f"{path}: the signing key cannot be stored: No space left on device"
    assert [entry.name for entry in path.parent.iterdir()] == [path.name]


def test_failure_is_logged_once_and_forgotten_with_a_save(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    store = FileKeyStore(path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", no_space)
        store.save(KEY.to_bytes())
        store.save(KEY.to_bytes())
    assert len(caplog.records) == 1
    assert store.save(KEY.to_bytes())
    assert store.failure is None


def test_key_is_never_logged(path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG)
    store = FileKeyStore(path)
    store.save(KEY.to_bytes())
    monkeypatch.setattr(os, "replace", no_space)
    store.save(KEY.to_bytes())
    assert not [form for form in (KEY.secret_key.hex(), repr(KEY.secret_key)[2:-1]) if form in caplog.text]
    assert "secret" not in repr(store)


def test_drafts_of_killed_processes_are_cleared_away(path: Path) -> None:
    path.parent.mkdir()
    stale = path.with_name(f".{path.name}.{'0' * 16}.draft")
    stale.write_bytes(KEY.to_bytes())
    FileKeyStore(path)
    assert not stale.exists()


def test_key_is_not_shown_over_ftp_beside_the_logs(path: Path) -> None:
    FileKeyStore(path).save(KEY.to_bytes())
    (path.parent / "00000001.BIN").write_bytes(b"log")
    files = VehicleFiles(ParamTable([]), log_directory=path.parent)
    for folder in LOG_FOLDERS:
        listed = files.list_directory(folder)
        assert not isinstance(listed, Failure)
        assert [entry.name for entry in listed] == ["00000001.BIN"]
        for name in (path.name, f"./{path.name}", f"../keys/{path.name}", f"00000001.BIN/../{path.name}"):
            assert isinstance(files.open_read(f"{folder}/{name}"), Failure)
    assert isinstance(files.open_read(str(path)), Failure)


class Session:
    """A vehicle from start to end, whose second link is a radio's."""

    def __init__(self, path: Path) -> None:
        self.vehicle = Vehicle(VehicleConfig(links=2, signing_store=FileKeyStore(path)))
        self._channels = [self.vehicle.endpoint.open_channel(name) for name in ("usb", "radio")]
        self._scheduler = Scheduler(self.vehicle)
        self._scheduler.run_until(100_000)

    def verdict(self, link: int, message: Message) -> str:
        """Return the rule that an unsigned message meets on a link."""
        self._scheduler.deliver(self._channels[link], Codec(255, 190).encode(message))
        event = self.vehicle.endpoint.next_event()
        assert event is not None
        return event.verdict.rule.code


def test_links_go_on_signing_after_a_restart(path: Path) -> None:
    alive = HEARTBEAT(6, 8, 0, 0, 4, 3)
    first = Session(path)
    assert first.verdict(1, alive) == "handled"
    assert first.verdict(0, SETUP_SIGNING(1, 1, tuple(KEY.secret_key), KEY.timestamp)) == "handled"
    first.vehicle.close()
    second = Session(path)
    assert second.verdict(0, alive) == "handled"
    assert second.verdict(1, alive) != "handled"
