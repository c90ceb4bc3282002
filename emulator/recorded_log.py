# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Reads what a recorded AHRS needs out of a DataFlash log."""

import lzma
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from pymavlink.DFReader import DFReader_binary

from ap_core.log_structure import FMT, HEAD_BYTE1, HEAD_BYTE2
from ekf_stub.ahrs_recorded import RecordedStates
from emulator.errors import InputError

T = TypeVar("T")

_FIRST_BYTES: Final = bytes((HEAD_BYTE1, HEAD_BYTE2, FMT.msg_type))
_CORE: Final = 0
_HORIZONTAL_POSITION: Final = 1 << 3 | 1 << 4  # relative or absolute, of XKF4.SS
_VERTICAL_POSITION: Final = 1 << 5


@contextmanager
def _plain_file(path: Path) -> Iterator[Path]:
    """Yield the path of the uncompressed log: pymavlink maps files into memory."""
    if path.suffix != ".xz":
        yield path
        return
    with tempfile.NamedTemporaryFile(suffix=".BIN") as plain:
        plain.write(lzma.decompress(path.read_bytes()))
        plain.flush()
        yield Path(plain.name)


def _collect(log: DFReader_binary) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]]]:
    attitudes: list[tuple[float, ...]] = []
    positions: list[tuple[float, ...]] = []
    has_position = False
    while (record := log.recv_match(type=["ATT", "XKF1", "XKF4"])) is not None:
        kind = record.get_type()
        if kind == "ATT":
            attitudes.append((record.TimeUS, record.Roll, record.Pitch, record.Yaw))
        elif record.C != _CORE:
            continue
        elif kind == "XKF4":
            # Written just before the XKF1 of the same time.
            has_position = bool(record.SS & _HORIZONTAL_POSITION and record.SS & _VERTICAL_POSITION)
        elif has_position:
            positions.append((record.TimeUS, record.PN, record.PE, record.PD))
    return attitudes, positions


def _begins_like_a_log(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(_FIRST_BYTES)) == _FIRST_BYTES


def read_log(path: Path, collect: Callable[[DFReader_binary], T]) -> T:
    """Return what ``collect`` makes of a log (.BIN or .BIN.xz).

    Raises:
        InputError: if it cannot be read.
    """
    try:
        with _plain_file(path) as plain:
            if not _begins_like_a_log(plain):
                raise InputError(f"{path}: not a DataFlash log")
            # DFReader prints what it thinks of a damaged log, which must not get into our output.
            with redirect_stdout(sys.stderr), DFReader_binary(str(plain)) as log:
                return collect(log)
    except lzma.LZMAError as error:
        raise InputError(f"{path}: damaged xz file: {error}") from error
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except InputError:
        raise
    except Exception as error:  # DFReader raises whatever a damaged log provokes
        raise InputError(f"{path}: not a DataFlash log: {error}") from error


def read_recorded_states(path: Path) -> RecordedStates:
    """Return attitude and position of a log (.BIN or .BIN.xz).

    Raises:
        InputError: if it cannot be read, or holds no ATT records.
    """
    attitudes, positions = read_log(path, _collect)
    if not attitudes:
        raise InputError(f"{path}: holds no ATT records to take the attitude from")
    att = np.array(attitudes, dtype=np.float64)
    pos = np.array(positions, dtype=np.float64).reshape(-1, 4)
    return RecordedStates(att[:, 0], att[:, 1:], pos[:, 0], pos[:, 1:])
