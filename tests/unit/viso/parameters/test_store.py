# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stored parameters: what the file looks like, damage, errors, and being killed at any instant."""

import errno
import fcntl
import logging
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ap_core.param import ParamTable
from ap_core.parm_file import parse_parm
from viso.errors import InputError
from viso.parameters.store import ParamStore, ParamStoreError
from viso.parameters.table import make_groups

OLD = {"VISO_TYPE": 1, "VISO_POS_X": 0.25}
NEW = {"VISO_TYPE": 3, "VISO_POS_X": -0.5, "LOG_DISARMED": 2}

SAVE_UNTIL_KILLED = """
import sys
from pathlib import Path
from viso.parameters.store import ParamStore

store = ParamStore(Path(sys.argv[1]))
number = int(store.load().get("P0", 0))
while True:
    number += 1
    assert store.save_if_changed({f"P{index}": number for index in range(400)})
    print(number, flush=True)
"""


class Killed(BaseException):
    """Stands for SIGKILL in the middle of a call."""


def no_space(*_: object, **__: object) -> int:
    raise OSError(errno.ENOSPC, "No space left on device")


def killed(*_: object, **__: object) -> int:
    raise Killed


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "vehicle" / "stored.parm"


def saved(path: Path, values: dict[str, float]) -> ParamStore:
    store = ParamStore(path)
    store.load()
    assert store.save_if_changed(values)
    return store


def write(path: Path, data: bytes) -> ParamStore:
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(data)
    return ParamStore(path)


def names_beside(path: Path) -> list[str]:
    return sorted(entry.name for entry in path.parent.iterdir())


class TestRoundTrip:
    def test_missing_file_holds_nothing(self, path: Path) -> None:
        assert ParamStore(path).load() == {}

    def test_values_come_back(self, path: Path) -> None:
        saved(path, OLD)
        assert ParamStore(path).load() == OLD

    def test_file_has_a_comment_and_a_line_a_parameter_sorted_by_name(self, path: Path) -> None:
        saved(path, OLD)
        lines = path.read_text().splitlines()
        assert lines[0].startswith("# ")
        assert lines[1:] == ["VISO_POS_X       0.25", "VISO_TYPE        1"]

    def test_file_reads_as_a_parameter_file(self, path: Path) -> None:
        saved(path, OLD)
        assert {line.name: line.value for line in parse_parm(path.read_text(), "stored")} == OLD

    def test_no_draft_stays_behind(self, path: Path) -> None:
        saved(path, OLD)
        assert names_beside(path) == ["stored.parm"]

    def test_float_is_written_as_short_as_float32_allows(self, path: Path) -> None:
        saved(path, {"A": float(np.float32(0.1))})
        assert path.read_text().endswith(" 0.1\n")

    def test_int32_keeps_every_digit(self, path: Path) -> None:
        saved(path, {"A": 2147483647, "B": -2147483648})
        assert ParamStore(path).load() == {"A": 2147483647, "B": -2147483648}

    @pytest.mark.slow
    @given(
        st.dictionaries(
            st.text("ABCXYZ019_", min_size=1, max_size=16),
            st.integers(-(1 << 31), (1 << 31) - 1)
            | st.floats(width=32, allow_nan=False, allow_infinity=False, allow_subnormal=True),
        )
    )
    def test_any_value_survives(self, tmp_path_factory: pytest.TempPathFactory, values: dict[str, float]) -> None:
        path = tmp_path_factory.mktemp("params") / "stored.parm"
        store = ParamStore(path)
        store.load()
        store.save_if_changed(values)
        loaded = ParamStore(path).load()
        assert {name: repr(value) for name, value in loaded.items()} == {
            name: repr(value) for name, value in values.items()
        }

    def test_edited_file_is_understood(self, path: Path) -> None:
        store = write(path, b"\xef\xbb\xbf# mine\r\n\r\n  A\t1 # why\r\nB +2.5e1\nC -3")
        assert store.load() == {"A": 1, "B": 25.0, "C": -3}

    def test_link_to_a_file_stays_a_link(self, path: Path, tmp_path: Path) -> None:
        saved(path, OLD)
        link = tmp_path / "link.parm"
        link.symlink_to(path)
        saved(link, NEW)
        assert link.is_symlink()
        assert ParamStore(path).load() == NEW


class TestSaveIfChanged:
    def test_same_values_are_not_written_again(self, path: Path) -> None:
        store = saved(path, OLD)
        path.write_bytes(b"")
        assert not store.save_if_changed(dict(OLD))
        assert path.read_bytes() == b""

    def test_file_that_was_deleted_is_written_again(self, path: Path) -> None:
        store = saved(path, OLD)
        shutil.rmtree(path.parent)
        assert store.save_if_changed(dict(OLD))
        assert ParamStore(path).load() == OLD

    def test_loaded_values_are_not_written_again(self, path: Path) -> None:
        saved(path, OLD)
        store = ParamStore(path)
        assert not store.save_if_changed(store.load())

    def test_nothing_to_store_makes_no_file(self, path: Path) -> None:
        store = ParamStore(path)
        store.load()
        assert not store.save_if_changed({})
        assert not path.parent.exists()

    def test_later_change_of_the_mapping_is_noticed(self, path: Path) -> None:
        values: dict[str, float] = dict(OLD)
        store = saved(path, values)
        values["VISO_TYPE"] = 2
        assert store.save_if_changed(values)

    def test_forgotten_value_leaves_the_file(self, path: Path) -> None:
        store = saved(path, OLD)
        store.save_if_changed({"VISO_TYPE": 1})
        assert ParamStore(path).load() == {"VISO_TYPE": 1}

    def test_saving_before_loading_is_refused(self, path: Path) -> None:
        saved(path, OLD)
        with pytest.raises(ValueError, match="load comes before save"):
            ParamStore(path).save_if_changed(NEW)
        assert ParamStore(path).load() == OLD

    def test_damaged_file_is_never_replaced(self, path: Path) -> None:
        store = write(path, b"VISO_TYPE\n")
        with pytest.raises(ParamStoreError):
            store.load()
        with pytest.raises(ValueError, match="load comes before save"):
            store.save_if_changed(NEW)

    @pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e39, 10**10, -(10**10)])
    def test_value_that_no_parameter_has_is_refused(self, path: Path, value: float) -> None:
        store = saved(path, OLD)
        with pytest.raises(ValueError, match="cannot be stored as a parameter"):
            store.save_if_changed({"A": value})
        assert ParamStore(path).load() == OLD

    @pytest.mark.parametrize("name", ["", "A B", "A#", "A" * 17, "A\n", "Ä"])
    def test_name_that_no_parameter_has_is_refused(self, path: Path, name: str) -> None:
        store = saved(path, OLD)
        with pytest.raises(ValueError, match="cannot be the name"):
            store.save_if_changed({name: 1})

    def test_last_of_several_processes_wins(self, path: Path) -> None:
        first, second = ParamStore(path), ParamStore(path)
        first.load()
        second.load()
        first.save_if_changed(OLD)
        second.save_if_changed(NEW)
        assert ParamStore(path).load() == NEW


class TestDamage:
    @pytest.mark.parametrize(
        ("data", "line", "reason"),
        [
            (b"", 1, "the file is empty"),
            (b"\n \n", 1, "the file is empty"),
            (b"# ok\nVISO_TYPE\n", 2, "not a name and a number: 'VISO_TYPE'"),
            (b"VISO_TYPE 1 2\n", 1, "not a name and a number: 'VISO_TYPE 1 2'"),
            (b"VISO_TYPE 1\nVISO_POS_X 0.2.5\n", 2, "not a name and a number: 'VISO_POS_X 0.2.5'"),
            (b"A nan\n", 1, "not a name and a number: 'A nan'"),
            (b"A 1e39\n", 1, "not a name and a number: 'A 1e39'"),
            (b"A 0x10\n", 1, "not a name and a number: 'A 0x10'"),
            (b"A\0B 1\n", 1, "not a name and a number: 'A\\x00B 1'"),
            (b"A" * 100, 1, f"not a name and a number: '{'A' * 60}'"),
            (b"A 1\nB 2\nA 3\n", 3, "A is in line 1 already"),
            (b"A 1\nB \xff\n", 2, "not UTF-8 text"),
        ],
    )
    def test_error_names_file_and_line(self, path: Path, data: bytes, line: int, reason: str) -> None:
        store = write(path, data)
        with pytest.raises(ParamStoreError) as error:
            store.load()
        assert str(error.value) == f"{path}:{line}: {reason}"

    def test_error_is_one_that_commands_tell(self) -> None:
        assert issubclass(ParamStoreError, InputError)

    def test_folder_in_place_of_the_file_is_an_error(self, path: Path) -> None:
        path.mkdir(parents=True)
        with pytest.raises(ParamStoreError) as error:
            ParamStore(path).load()
        assert str(error.value) == f"{path}: Is a directory"

    @given(st.binary(max_size=200))
    def test_any_bytes_give_values_or_one_line(self, tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
        store = write(tmp_path_factory.mktemp("params") / "stored.parm", data)
        text = ""
        try:
            store.load()
        except ParamStoreError as error:
            text = str(error)
        assert "\n" not in text


class TestRestore:
    @pytest.fixture
    def params(self) -> ParamTable:
        return ParamTable(make_groups(1))

    def test_table_gets_its_values_and_counts_them_as_stored(self, path: Path, params: ParamTable) -> None:
        saved(path, {"LOG_DISARMED": 2, "AHRS_TRIM_X": 0.125})
        ParamStore(path).restore(params)
        assert (params.get_int("LOG_DISARMED"), "LOG_DISARMED" in params.stored_values()) == (2, True)
        assert params.find("AHRS_TRIM_X").value == np.float32(0.125)  # type: ignore[union-attr]  # it is known

    def test_what_mavlink_sets_is_there_after_a_restart(self, path: Path, params: ParamTable) -> None:
        store = ParamStore(path)
        store.restore(params)
        params.set_from_mavlink("ARMING_SKIPCHK", 2**31)
        store.save_if_changed(params.stored_values())
        again = ParamTable(make_groups(1))
        ParamStore(path).restore(again)
        assert again.get_int("ARMING_SKIPCHK") == 2**31 - 1
        assert again.stored_values() == params.stored_values()

    def test_unknown_names_are_reported_and_kept(
        self, path: Path, params: ParamTable, caplog: pytest.LogCaptureFixture
    ) -> None:
        saved(path, {"LOG_DISARMED": 2, "NEW_THING": 7, "OLD_THING": 0.5})
        store = ParamStore(path)
        store.restore(params)
        assert store.unknown == {"NEW_THING": 7, "OLD_THING": 0.5}
        assert [record.levelno for record in caplog.records] == [logging.WARNING]
        assert caplog.messages == [f"{path}: unknown parameters, kept in the file: NEW_THING, OLD_THING"]
        assert not store.save_if_changed(params.stored_values())
        params.set_from_mavlink("LOG_DISARMED", 3)
        assert store.save_if_changed(params.stored_values())
        assert ParamStore(path).load() == {"LOG_DISARMED": 3, "NEW_THING": 7, "OLD_THING": 0.5}

    def test_nothing_is_told_when_every_name_is_known(
        self, path: Path, params: ParamTable, caplog: pytest.LogCaptureFixture
    ) -> None:
        saved(path, {"LOG_DISARMED": 2})
        ParamStore(path).restore(params)
        assert caplog.messages == []

    @pytest.mark.parametrize("value", ["300", "1.5", "-129", "4294967297"])
    def test_value_that_its_parameter_cannot_take_is_damage(self, path: Path, params: ParamTable, value: str) -> None:
        store = write(path, f"# mine\nLOG_DISARMED {value}\n".encode())
        with pytest.raises(ParamStoreError) as error:
            store.restore(params)
        assert str(error.value) == f"{path}:2: LOG_DISARMED cannot be {value}"
        assert params.get_int("LOG_DISARMED") == 1

    def test_float_may_be_written_as_any_number(self, path: Path, params: ParamTable) -> None:
        write(path, b"FS_EKF_THRESH 16777217\n").restore(params)
        assert params.get_float("FS_EKF_THRESH") == np.float32(16777216)

    @pytest.mark.parametrize("name", ["log_disarmed", "AHRS_TRIM"])
    def test_other_spellings_and_whole_vectors_are_unknown(self, path: Path, params: ParamTable, name: str) -> None:
        store = write(path, f"{name} 300\n".encode())
        store.restore(params)
        assert store.unknown == {name: 300}

    def test_damaged_file_changes_nothing(self, path: Path, params: ParamTable) -> None:
        store = write(path, b"LOG_DISARMED 2\nVISO_TYPE\n")
        with pytest.raises(ParamStoreError):
            store.restore(params)
        assert params.stored_values() == {}


class TestErrors:
    @pytest.mark.parametrize("call", ["open", "write", "fsync", "replace"])
    def test_error_leaves_the_old_file_and_no_draft(
        self, path: Path, monkeypatch: pytest.MonkeyPatch, call: str
    ) -> None:
        store = saved(path, OLD)
        with monkeypatch.context() as patch:
            patch.setattr(os, call, no_space)
            assert not store.save_if_changed(NEW)
        assert ParamStore(path).load() == OLD
        assert names_beside(path) == ["stored.parm"]

    @pytest.mark.parametrize("call", ["open", "write", "fsync", "replace"])
    def test_kill_leaves_the_old_file(self, path: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
        store = saved(path, OLD)
        with monkeypatch.context() as patch:
            patch.setattr(os, call, killed)
            patch.setattr(Path, "unlink", killed)
            with pytest.raises(Killed):
                store.save_if_changed(NEW)
        assert ParamStore(path).load() == OLD

    def test_kill_in_the_middle_of_a_write_leaves_the_old_file(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        store = saved(path, OLD)
        write_all = os.write
        with monkeypatch.context() as patch:
            patch.setattr(os, "write", lambda fd, data: write_all(fd, data[:20]) and killed())
            with pytest.raises(Killed):
                store.save_if_changed(NEW)
        assert ParamStore(path).load() == OLD

    def test_kill_after_the_exchange_leaves_the_new_file(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        store = saved(path, OLD)
        with monkeypatch.context() as patch:
            patch.setattr("viso.files.outputs._sync_folder", killed)
            with pytest.raises(Killed):
                store.save_if_changed(NEW)
        assert ParamStore(path).load() == NEW

    def test_short_writes_are_continued(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        write_all = os.write
        monkeypatch.setattr(os, "write", lambda fd, data: write_all(fd, data[:7]))
        saved(path, NEW)
        assert ParamStore(path).load() == NEW

    def test_file_is_on_disk_before_the_exchange_and_the_folder_after_it(
        self, path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        calls: list[str] = []

        def noted(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
            def call(*args: Any) -> Any:
                calls.append(name)
                return function(*args)

            return call

        monkeypatch.setattr(os, "fsync", noted("fsync", os.fsync))
        monkeypatch.setattr(os, "replace", noted("replace", os.replace))
        store = saved(path, OLD)
        assert calls == ["fsync", "replace", "fsync"]
        calls.clear()
        assert store.save_if_changed(NEW, synced=False)
        assert not store.save_if_changed(NEW, synced=False)
        assert calls == ["replace"]
        assert store.save_if_changed(NEW)
        assert not store.save_if_changed(NEW)
        assert calls == ["replace", "fsync", "replace", "fsync"]

    @pytest.mark.parametrize(("code", "works"), [(errno.EINVAL, True), (errno.EIO, False)])
    def test_folder_that_cannot_be_synced_is_no_error_where_that_is_not_possible(
        self, path: Path, monkeypatch: pytest.MonkeyPatch, code: int, works: bool
    ) -> None:
        store = saved(path, OLD)
        sync, descriptors = os.fsync, []

        def fail_for_the_folder(descriptor: int) -> None:
            descriptors.append(descriptor)
            if len(descriptors) == 2:
                raise OSError(code, os.strerror(code))
            sync(descriptor)

        monkeypatch.setattr(os, "fsync", fail_for_the_folder)
        assert store.save_if_changed(NEW) is works
        assert ParamStore(path).load() == NEW

    def test_first_error_is_told_all_are_counted(
        self, path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        store = saved(path, OLD)
        monkeypatch.setattr(os, "replace", no_space)
        for _ in range(3):
            assert not store.save_if_changed(NEW)
        text = f"{path}: parameters cannot be stored: No space left on device"
        assert (caplog.messages, store.failure) == ([text], text)

    def test_error_without_words_is_told_as_it_is(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def fail(*_: object) -> None:
            raise OSError("something else")

        store = saved(path, OLD)
        monkeypatch.setattr(os, "replace", fail)
        store.save_if_changed(NEW)
        assert store.failure == f"{path}: parameters cannot be stored: something else"

    def test_save_that_failed_is_made_up_for(
        self, path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        store = saved(path, OLD)
        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", no_space)
            store.save_if_changed(NEW)
        assert store.save_if_changed(NEW)
        assert (ParamStore(path).load(), store.failure) == (NEW, None)
        with monkeypatch.context() as patch:
            patch.setattr(os, "replace", no_space)
            store.save_if_changed(OLD)
        assert len(caplog.messages) == 2

    def test_folder_that_cannot_be_made_is_told(self, tmp_path: Path) -> None:
        (tmp_path / "file").touch()
        store = ParamStore(tmp_path / "folder" / "stored.parm")
        store.load()
        (tmp_path / "folder").symlink_to(tmp_path / "file")
        assert not store.save_if_changed(OLD)
        assert store.failure is not None

    def test_file_system_without_locks_will_do(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def no_locks(*_: object) -> None:
            raise OSError(errno.ENOLCK, "No locks available")

        monkeypatch.setattr(fcntl, "flock", no_locks)
        saved(path, OLD)
        assert ParamStore(path).load() == OLD


class TestDrafts:
    DRAFT = ".stored.parm.0123456789abcdef.draft"

    def test_draft_of_a_killed_process_is_removed_at_the_next_load(self, path: Path) -> None:
        saved(path, OLD)
        path.with_name(self.DRAFT).write_text("half")
        ParamStore(path).load()
        assert names_beside(path) == ["stored.parm"]

    def test_draft_in_use_is_left_alone(self, path: Path) -> None:
        saved(path, OLD)
        with path.with_name(self.DRAFT).open("w") as draft:
            fcntl.flock(draft.fileno(), fcntl.LOCK_EX)
            ParamStore(path).load()
        assert names_beside(path) == [self.DRAFT, "stored.parm"]

    @pytest.mark.parametrize("name", [".stored.parm.draft", "stored.parm.bak", ".other.parm.0123456789abcdef.draft"])
    def test_other_files_are_left_alone(self, path: Path, name: str) -> None:
        saved(path, OLD)
        path.with_name(name).touch()
        ParamStore(path).load()
        assert names_beside(path) == sorted([name, "stored.parm"])

    def test_every_draft_has_a_name_of_its_own(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        names: list[str] = []
        exchange = os.replace

        def noted(draft: Path, target: Path) -> None:
            names.append(draft.name)
            exchange(draft, target)

        monkeypatch.setattr(os, "replace", noted)
        saved(path, OLD)
        saved(path, NEW)
        assert len(set(names)) == 2


@pytest.mark.slow
def test_process_killed_at_any_instant_leaves_a_whole_file(path: Path) -> None:
    for round_number in range(15):
        with subprocess.Popen(
            [sys.executable, "-c", SAVE_UNTIL_KILLED, str(path)], stdout=subprocess.PIPE, text=True
        ) as child:
            assert child.stdout is not None
            told = [int(child.stdout.readline()) for _ in range(1 + round_number * 3)]
            child.kill()
            told += [int(line) for line in child.stdout if line.endswith("\n")]
        values = ParamStore(path).load()
        assert len(values) == 400
        assert len(set(values.values())) == 1
        assert values["P0"] >= told[-1]
    assert names_beside(path) == ["stored.parm"]
