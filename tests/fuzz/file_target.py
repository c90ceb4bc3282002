# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The readers of files as a fuzz target: the first byte of the data chooses the reader, the rest is the file."""

import gzip
import math
import tempfile
from collections.abc import Callable
from pathlib import Path

from ap_core.param import ParamTable
from ap_visualodom.ap_visualodom import make_params
from viso.errors import InputError
from viso.logs.files import MAX_FILES, LogStore
from viso.logs.recorded import read_recorded_states
from viso.options.settings import load_parm_file, parse_assignment
from viso.parameters.store import ParamStore
from viso.parameters.table import make_groups
from viso.streams.stream_kinds import Stream, read_stream

LEAD_US = 30_000_000


def _table() -> ParamTable:
    return ParamTable(make_groups(1, make_params()))


def _file(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def read_parm(content: bytes, folder: Path) -> None:
    """Read a parameter file."""
    values = load_parm_file(_file(folder, "any.parm", content), _table(), allow_unknown=True)
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


READERS: tuple[Callable[[bytes, Path], None], ...] = (
    read_parm,
    read_storage,
    read_capture,
    read_tlog,
    read_assignment,
    read_packed_capture,
    read_last_number,
    read_log,
)


def run(data: bytes, folder: Path) -> None:
    """Read the data as a file; a reader either succeeds or raises InputError.

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
    except InputError as error:
        said = str(error)
    assert "\n" not in said, "an error of more than one line"
