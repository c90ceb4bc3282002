# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A live topic with poses: found in the graph whatever its type is, and read whoever writes it how."""

from collections import Counter
from typing import Any, Final, NamedTuple

from viso.dds.graph import Participant, Qos, Reader, check_domain, require_cyclonedds
from viso.streams.bag_formats import FRAME_TYPES, POSE_TYPES, PoseMessage

SCHEME: Final = "ros2:"
TRANSFORM: Final = "geometry_msgs/msg/TransformStamped"
_ALL_WRITERS: Final = Qos(reliable=False, lasting=False, depth=100)
_MOST_PAIRS: Final = 100
_LISTED: Final = 10


def live_topic_of(source: str) -> str | None:
    """Return the topic that ``ros2:/topic`` names; None for any other text."""
    return source.removeprefix(SCHEME) if source.startswith(SCHEME) else None


class Heard(NamedTuple):
    """A pose of a topic, when it was written by its writer's clock, and who that is: another number after a restart."""

    writer: int
    written_ns: int
    message: PoseMessage


class PoseTopic:
    """A topic to be listened to: Odometry, a pose with or without covariance, or transforms between frames.

    Its name is such as ``/odom``, or ``/tf:PARENT.CHILD``; ``domain`` is ROS_DOMAIN_ID. Its ``kind``, the type of its
    messages, is None until somebody writes it. Raises InputError if the extra is missing, there is no such domain, or
    DDS does not start.
    """

    def __init__(self, name: str, domain: int) -> None:
        require_cyclonedds(SCHEME + name)
        check_domain(domain, "--domain")
        topic, _, self._frames = name.partition(":")
        self.name = "/" + topic.lstrip("/")
        self.kind: str | None = None
        self._domain = domain
        self._graph = Participant(domain)
        self._reader: Reader[Any] | None = None
        self._pairs: Counter[str] = Counter()

    def find(self) -> bool:
        """Begin to read as soon as somebody writes the topic with a type that can be read; say whether it is."""
        from viso.dds.messages import POSES

        if self._reader is None:
            kinds = self._graph.topics().get(self.name, set()) & POSES.keys()
            if kinds:
                self.kind = min(kinds)
                self._reader = self._graph.reader(self.name, POSES[self.kind], _ALL_WRITERS)
        return self._reader is not None

    def fileno(self) -> int:
        """Return the descriptor to wait on, -1 until the topic is found."""
        return -1 if self._reader is None else self._reader.fileno()

    def take(self, now_ns: int) -> list[Heard]:
        """Return what has come since the last time; ``now_ns`` is taken for when it came."""
        if self._reader is None or self.kind is None:
            return []
        heard = []
        for sample in self._reader.take():
            info = sample.sample_info
            poses = self._transforms(sample) if self.kind in FRAME_TYPES else [(self.kind, sample)]
            heard += [
                Heard(info.publication_handle, info.source_timestamp, (now_ns, kind, pose)) for kind, pose in poses
            ]
        return heard

    def _transforms(self, message: Any) -> list[tuple[str, Any]]:
        wanted = []
        for one in message.transforms:
            frames = f"{one.header.frame_id}.{one.child_frame_id}"
            if len(self._pairs) < _MOST_PAIRS or frames in self._pairs:
                self._pairs[frames] += 1
            if frames == self._frames:
                wanted.append((TRANSFORM, one))
        return wanted

    def silence(self) -> str:
        """Return why there may be nothing to take, in one line."""
        topics = self._graph.topics()
        kinds = topics.get(self.name, set())
        where = f"in the domain {self._domain}"
        if not kinds:
            poses = sorted(name for name, types in topics.items() if types & (POSE_TYPES.keys() | FRAME_TYPES))
            listed = ", ".join(poses[:_LISTED]) or "none"
            return f"nobody writes it {where}; topics with poses are: {listed}"
        if self._reader is None:
            return f"it carries {', '.join(sorted(kinds))}, and poses are of {', '.join(POSE_TYPES)}"
        if self.kind in FRAME_TYPES:
            pairs = ", ".join(f"{self.name}:{frames}" for frames in sorted(self._pairs)[:_LISTED])
            return f"no transforms {self._frames or 'named, as in /tf:odom.base_link'}; there are: {pairs or 'none'}"
        if self._reader.damaged:
            return f"{self._reader.damaged} messages could not be read"
        return f"it is written {where}, but nothing comes"

    @property
    def damaged(self) -> int:
        """How many messages could not be read."""
        return 0 if self._reader is None else self._reader.damaged

    def close(self) -> None:
        """Leave the graph."""
        self._graph.close()
