# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The readers of files as a fuzz target: the first byte of the data chooses the reader, the rest is the file."""

import gzip
import math
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from viso.companion.vio.calibration import CalibrationError, load_calibration
from viso.companion.vio.config import ConfigError, load_config
from viso.errors import InputError
from viso.faults import TimelineError, load_timeline
from viso.landmarks.camera import camera_of
from viso.logs.files import MAX_FILES, LogStore
from viso.logs.recorded import read_recorded_states
from viso.parameters.store import ParamStore
from viso.parameters.table import make_groups
from viso.streams.stream_kinds import Stream, read_stream
from viso.sweep.request import read_request
from viso.terminal.settings import load_parm_file, parse_assignment
from viso.vehicle.sensors.script.script import read_script_source

LEAD_US = 30_000_000
REFUSALS = (InputError, CalibrationError, ConfigError, TimelineError)


def _table() -> ParamTable:
    return ParamTable(make_groups(1, make_params()))


def _file(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def read_parm(content: bytes, folder: Path) -> None:
    """Read a parameter file."""
    values = load_parm_file(_file(folder, "any.parm", content), _table())
    assert all(math.isfinite(value) for value in values.values())
    _table().apply_defaults(values, "fuzz")


def read_assignment(content: bytes, _folder: Path) -> None:
    """Read an assignment of the command line."""
    name, value = parse_assignment(content.decode("utf-8", "surrogateescape"), _table())
    assert math.isfinite(value)
    _table().set(name, value)


def read_storage(content: bytes, folder: Path) -> None:
    """Restore stored parameters, and store them again without loss."""
    path = _file(folder, "storage.parm", content)
    params = _table()
    store = ParamStore(path)
    store.restore(params)
    kept = {**store.unknown, **params.stored_values()}
    store.save_if_changed({**params.stored_values(), "VISO_FUZZ": 1})
    assert ParamStore(path).load() == {**kept, "VISO_FUZZ": 1}


def _check_stream(stream: Stream) -> None:
    arrivals = [one.arrival_us for one in stream.messages if one.arrival_us is not None]
    assert arrivals == sorted(arrivals)
    assert all(math.isfinite(value) for value in stream.params.values())


def read_capture(content: bytes, folder: Path) -> None:
    """Read a capture."""
    _check_stream(read_stream(_file(folder, "any.jsonl", content), LEAD_US))


def read_packed_capture(content: bytes, folder: Path) -> None:
    """Read a capture through gzip."""
    _check_stream(read_stream(_file(folder, "packed.jsonl.gz", gzip.compress(content, 1)), LEAD_US))


def read_tlog(content: bytes, folder: Path) -> None:
    """Read a telemetry log, packed if it says so."""
    _check_stream(read_stream(_file(folder, "any.tlog", content), LEAD_US))


def read_last_number(content: bytes, folder: Path) -> None:
    """Open the next log in a folder whose LASTLOG.TXT has this content."""
    with tempfile.TemporaryDirectory(dir=folder) as logs:
        Path(logs, "LASTLOG.TXT").write_bytes(content)
        with LogStore(Path(logs)).open_next() as log:
            assert 1 <= log.number <= MAX_FILES


def read_log(content: bytes, folder: Path) -> None:
    """Read the recorded states of a DataFlash log."""
    states = read_recorded_states(_file(folder, "any.BIN", b"\xa3\x95\x80" + content))
    assert states is not None


def _written_as(name: str, read: Callable[[Path], object]) -> Callable[[bytes, Path], None]:
    """Return what writes a file of this name, and has it read."""

    def run_reader(content: bytes, folder: Path) -> None:
        read(_file(folder, name, content))

    return run_reader


@lru_cache
def _bag(version: int) -> bytes:
    """Return a small bag with three poses, of ROS 1 or 2."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    store: Any = get_typestore((Stores.ROS1_NOETIC, Stores.ROS2_HUMBLE)[version - 1])
    kind, types = "geometry_msgs/msg/PoseStamped", store.types
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "bag")
        bag: Any = Writer1(path) if version == 1 else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
        with bag as writer:
            connection = writer.add_connection("/pose", kind, typestore=store)
            for sec in (5, 6, 7):
                stamp = types["builtin_interfaces/msg/Time"](sec, 0)
                head = types["std_msgs/msg/Header"](*([0] if version == 1 else []), stamp, "map")
                point = types["geometry_msgs/msg/Point"](1.0, 2.0, 3.0)
                pose = types["geometry_msgs/msg/Pose"](point, types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0))
                serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
                writer.write(connection, sec * 10**9, serialize(types[kind](head, pose), kind))
        return path.read_bytes() if version == 1 else next(path.glob("*.mcap")).read_bytes()


def _damaged_bag(version: int, content: bytes) -> bytes:
    """Return a bag with bytes changed, each three of the content a place and what stands there, and perhaps cut."""
    data = bytearray(_bag(version))
    for at in range(0, len(content) - 2, 3):
        data[int.from_bytes(content[at : at + 2], "big") % len(data)] = content[at + 2]
    rest = len(content) % 3
    return bytes(data[: int.from_bytes(content[-rest:], "big") % len(data)] if rest else data)


def read_bag(content: bytes, folder: Path) -> None:
    """Read a damaged bag of ROS 1."""
    _check_stream(read_stream(_file(folder, "any.bag", _damaged_bag(1, content)), LEAD_US))


def read_mcap(content: bytes, folder: Path) -> None:
    """Read a damaged bag of ROS 2."""
    _check_stream(read_stream(_file(folder, "any.mcap", _damaged_bag(2, content)), LEAD_US))


READERS: tuple[Callable[[bytes, Path], None], ...] = (
    read_parm,
    read_storage,
    read_capture,
    read_tlog,
    read_assignment,
    read_packed_capture,
    read_last_number,
    read_log,
    _written_as("sweep.toml", read_request),
    _written_as("vio.toml", load_config),
    _written_as("camera.toml", load_calibration),
    _written_as("sensor.yaml", load_calibration),
    _written_as("landmarks.toml", lambda path: camera_of(path, [])),
    _written_as("script.toml", lambda path: read_script_source(str(path))),
    _written_as("faults.yaml", load_timeline),
    read_bag,
    read_mcap,
)


def run(data: bytes, folder: Path) -> None:
    """Read the data as a file; a reader either succeeds or refuses it with one line.

    Args:
        data: number of the reader, then the content.
        folder: for the file; nothing else is to use it.

    Raises:
        Exception: a finding.
    """
    if not data:
        return
    said = ""
    try:
        READERS[data[0] % len(READERS)](data[1:], folder)
    except REFUSALS as error:
        said = str(error)
    assert "\n" not in said, "an error of more than one line"
