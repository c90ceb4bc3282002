# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of recorded streams, a file each; their table is in ``viso.streams.stream_kinds``."""

from viso.streams.stream import Aspect, Stream, StreamMessage
from viso.streams.stream_kinds import STREAM_KINDS, StreamKind, read_stream
from viso.streams.trajectory import TrajectoryOptions

__all__ = ["STREAM_KINDS", "Aspect", "Stream", "StreamKind", "StreamMessage", "TrajectoryOptions", "read_stream"]
