# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The file of missions, fences and rally points."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_handlers.transfers.mission_items import MissionItem, MissionType
from viso.files.item_store import FileItemStore, ItemStoreError

MISSION = (MissionItem(16), MissionItem(22, 3, z=20.0), MissionItem(16, 3, (1.5, 0.0, 0.0, 0.0), -1, 2, 20.1))
PLANS = {MissionType.MISSION: MISSION, MissionType.FENCE: (MissionItem(5003, params=(12.5, 0.0, 0.0, 0.0)),)}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "plans" / "missions.txt"


def no_space(*_args: object) -> None:
    raise OSError(28, "No space left on device")


def test_nothing_is_written_while_there_is_nothing(path: Path) -> None:
    store = FileItemStore(path)
    assert store.load() == {}
    assert not store.save_if_changed({MissionType.MISSION: []})
    assert not path.parent.exists()


singles = st.floats(width=32, allow_nan=False, allow_infinity=False)
items = st.builds(
    MissionItem,
    st.integers(0, 65_535),
    st.sampled_from([0, 3]),
    st.tuples(*[singles] * 4),
    st.integers(-(2**31) + 1, 2**31 - 1),
    st.integers(-(2**31) + 1, 2**31 - 1),
    singles,
)


@given(plans=st.dictionaries(st.sampled_from(MissionType), st.lists(items, min_size=1, max_size=4).map(tuple)))
def test_items_outlive_the_store(
    plans: dict[MissionType, tuple[MissionItem, ...]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("plans") / "missions.txt"
    assert FileItemStore(path).save_if_changed(plans, synced=False) == bool(plans)
    assert FileItemStore(path).load() == plans


def test_same_items_are_written_once_and_then_synced(path: Path) -> None:
    store = FileItemStore(path)
    saved = [store.save_if_changed(PLANS, synced=synced) for synced in (False, False, True, True, False)]
    assert saved == [True, False, True, False, False]


@pytest.mark.parametrize("line", [
    "0 3 22 0 0 0 0 0 0",
    "0 3 22 0 0 0 0 0 0 nan",
    "0 3 22 0 0 0 zero 0 0 0",
    "3 3 22 0 0 0 0 0 0 0",
    "0 3 22 0 0 0 0 0.5 0 0",
    "0 3 22 0 0 0 0 9999999999 0 0",
])  # fmt: skip
def test_damaged_file_is_one_line_that_names_it(path: Path, line: str) -> None:
    path.parent.mkdir()
    path.write_text(f"# items\n0 0 16 0 0 0 0 0 0 0\n{line}\n")
    with pytest.raises(ItemStoreError) as error:
        FileItemStore(path)
    assert str(error.value) == f"{path}:3: not an item: {line!r}"


def test_file_that_is_no_text_is_one_line(path: Path) -> None:
    path.parent.mkdir()
    path.write_bytes(b"\xff")
    with pytest.raises(ItemStoreError, match="not a text of missions"):
        FileItemStore(path)


def test_file_that_cannot_be_read_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ItemStoreError) as error:
        FileItemStore(tmp_path)
    assert str(error.value) == f"{tmp_path}: Is a directory"


def test_failure_is_logged_once_and_forgotten_with_a_save(
    path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    store = FileItemStore(path)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", no_space)
        assert not store.save_if_changed(PLANS)
        assert not store.save_if_changed(PLANS)
        assert store.failure == f"{path}: missions cannot be stored: No space left on device"
    assert len(caplog.records) == 1
    assert store.save_if_changed(PLANS)
    assert store.failure is None
