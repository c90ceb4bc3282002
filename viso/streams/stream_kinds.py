# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded streams of every kind: a new one is a file beside this one, and a row here."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple

from ap_core.plugins import with_plugins
from mav_handlers.links.packed import PACKED_ENDINGS, name_unpacked
from viso.errors import InputError
from viso.files.first_bytes import Content, content_of
from viso.streams.capture import CAPTURE_BAUD, read_capture
from viso.streams.flight_log import read_flight_log
from viso.streams.link_bytes import read_link_bytes
from viso.streams.recorded_poses import read_as_recorded
from viso.streams.stream import MAX_GAP_US, Aspect, Stream, StreamMessage
from viso.streams.telemetry_log import read_telemetry_log
from viso.streams.trajectory import TrajectoryOptions, read_trajectory

__all__ = [
    "CAPTURE_BAUD",
    "MAX_GAP_US",
    "STREAM_KINDS",
    "Aspect",
    "Stream",
    "StreamKind",
    "StreamMessage",
    "TrajectoryOptions",
    "kind_of",
    "read_as_recorded",
    "read_capture",
    "read_flight_log",
    "read_stream",
    "read_telemetry_log",
    "read_trajectory",
]

TRAJECTORY: Final = "trajectory"
DATAFLASH_LOG: Final = Content.DATAFLASH_LOG.value
_AS_A_TRAJECTORY: Final = TrajectoryOptions()


class StreamKind(NamedTuple):
    """A kind of recorded streams.

    Attributes:
        endings: of the names of its files, in small letters, without those of packed files.
        content: what it holds.
        params: where the parameters come from.
        read: reads a file, given the time in us from boot to the first message where the file has none since boot.
        begins_as: what its files are by their first bytes, whatever their names; None if by the ending alone.
    """

    endings: tuple[str, ...]
    content: str
    params: str
    read: Callable[[Path, int, TrajectoryOptions], Stream]
    begins_as: Content | None = None


STREAM_KINDS: Final[Mapping[str, StreamKind]] = MappingProxyType(
    {
        "capture": StreamKind(
            (".jsonl",),
            "a conversation with the firmware: a line that describes it, a line a message",
            "its first line",
            lambda path, _lead_us, _options: read_capture(path),
        ),
        "telemetry log": StreamKind(
            (".tlog",),
            "frames with the time of day, from a ground station or `viso play`",
            "PARAM_VALUE, and `@PARAM/param.pck` by MAVLink FTP",
            lambda path, lead_us, _options: read_telemetry_log(path, lead_us),
            Content.TELEMETRY_LOG,
        ),
        "bytes of a link": StreamKind(
            (".tlog.raw", ".rlog"),
            "frames without times, from MAVProxy or Mission Planner; times are those of the autopilot's messages",
            "PARAM_VALUE, and `@PARAM/param.pck` by MAVLink FTP",
            lambda path, _lead_us, _options: read_link_bytes(path),
            Content.LINK_BYTES,
        ),
        DATAFLASH_LOG: StreamKind(
            (".bin", ".log"),
            "the autopilot's own log: messages are rebuilt from VISP, VISV and VISO",
            "PARM",
            lambda path, _lead_us, _options: read_flight_log(path),
            Content.DATAFLASH_LOG,
        ),
        TRAJECTORY: StreamKind(
            (".tum", ".txt", ".csv", ".bag", ".mcap", ".db3"),
            "poses of an odometry or a motion capture, in any format of `viso play`; the folder of a bag as well",
            "",
            read_trajectory,
        ),
    }
)


def all_kinds() -> Mapping[str, StreamKind]:
    """Return the kinds by their names, those of plug-ins too."""
    return with_plugins("viso.streams", STREAM_KINDS, StreamKind)


def _by_ending(name: str, kinds: Mapping[str, StreamKind]) -> str | None:
    return next((kind for kind, row in kinds.items() if name.endswith(row.endings)), None)


def kind_of(path: Path, options: TrajectoryOptions = _AS_A_TRAJECTORY) -> str:
    """Return the name of the kind of a file, packed or not, by its first bytes, or else by the ending of its name.

    A folder is a bag, and what has a format of trajectories given is a trajectory. Raises InputError if it is of no
    kind known, or options are given that it has no use for.
    """
    content, name = content_of(path), name_unpacked(path).lower()
    found = next((kind for kind, row in STREAM_KINDS.items() if content and row.begins_as is content), None)
    found = found or _by_ending(name, STREAM_KINDS)
    if found is None and (path.is_dir() or options.format_name is not None):
        found = TRAJECTORY
    if found is None:
        found = _by_ending(name, all_kinds())
    if found is None:
        known = ", ".join(f"{kind} ({', '.join(row.endings)})" for kind, row in all_kinds().items())
        packed = ", ".join(PACKED_ENDINGS)
        is_there = path.exists()
        what = (
            "by its first bytes and its ending no recorded stream" if is_there else "by its ending no recorded stream"
        )
        raise InputError(f"{path}: {what}; there are: {known}; each also packed ({packed})")
    if found != TRAJECTORY and options != _AS_A_TRAJECTORY:
        raise InputError(f"{path}: --as, --format, --topic, --times, --axes and --rate are for trajectories")
    return found


def read_stream(path: Path, lead_us: int, options: TrajectoryOptions = _AS_A_TRAJECTORY) -> Stream:
    """Read a recorded stream; see ``kind_of`` for how its kind is found.

    Args:
        path: the file, or the folder of a bag.
        lead_us: from boot to the first message, where the recording does not tell the time since boot.
        options: how to take a trajectory.

    Raises:
        InputError: if the kind is unknown or the file cannot be read.
    """
    kind = kind_of(path, options)
    return (STREAM_KINDS.get(kind) or all_kinds()[kind]).read(path, lead_us, options)


def read_whole_stream(
    path: Path, lead_us: int, options: TrajectoryOptions = _AS_A_TRAJECTORY, form: str | None = None
) -> Stream:
    """Read a recorded stream with all its faults; see ``read_stream``, and ``read_as_recorded`` for trajectories.

    A log without external navigation is read as well: its parameters may tell why it has none. Raises InputError if the
    kind is unknown or the file cannot be read.
    """
    kind = kind_of(path, options if form is None else replace(options, form=form))
    if kind == TRAJECTORY:
        return read_as_recorded(path, lead_us, options, form)
    if kind == DATAFLASH_LOG:
        return read_flight_log(path, may_be_empty=True)
    return read_stream(path, lead_us, options)
