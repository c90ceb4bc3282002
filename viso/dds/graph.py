# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Topics of a ROS 2 graph, read and written over DDS; no ROS needs to be installed.

Use it so, with ``--dds 0`` or the ROS_DOMAIN_ID of those to be met::

    require_cyclonedds("--ros2")  # InputError with what to install
    from viso.dds.messages import Odometry

    with Participant(domain) as graph:
        odometry = graph.reader("/odom", Odometry, SENSOR_DATA)
        out = graph.writer("/copy", Odometry, DEFAULT)
        while odometry.wait(1.0):  # False once nothing came for a second
            for sample in odometry.take():
                out.write(sample)

A reader wakes whoever waits on its ``fileno``, so it may stand in one ``poll`` with sockets. ``take`` never raises for
what somebody else sent: what cannot be read is counted in ``damaged``. Which networks DDS uses is for CYCLONEDDS_URI
to say, as for ROS 2 with rmw_cyclonedds.
"""

import contextlib
import os
import select
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Final, Generic, TypeVar

from viso.errors import InputError
from viso.extras import pip_install

T = TypeVar("T")
U = TypeVar("U")

MISSING_EXTRA: Final = f"ROS 2 topics are read and written with cyclonedds; install it with: {pip_install('ros2')}"
MOST_AT_ONCE: Final = 100
MAX_DOMAIN: Final = 232
"""The highest domain whose ports exist; beyond 101 some belong to the system's outgoing connections."""
_PREFIX: Final = "rt/"
_MOST_WRITERS: Final = 10_000


@dataclass(frozen=True, slots=True)
class Qos:
    """What a reader asks, or a writer offers.

    A reader meets only a writer that is as reliable and as lasting as itself.

    Attributes:
        reliable: what is lost is sent again.
        lasting: who comes later gets the last ones as well (transient local).
        depth: so many are kept that nobody has taken yet; the oldest goes first.
    """

    reliable: bool
    lasting: bool
    depth: int


SENSOR_DATA: Final = Qos(reliable=False, lasting=False, depth=5)
"""As ROS 2's profile for sensors; a reader with it meets every writer."""
DEFAULT: Final = Qos(reliable=True, lasting=False, depth=10)
"""As ROS 2's for topics; a writer with it meets every reader but lasting ones."""
LATCHED: Final = Qos(reliable=True, lasting=True, depth=1)
"""For what is sent once, such as /tf_static."""


def require_cyclonedds(asker: str) -> None:
    """Raise InputError, in one line that begins with the option that asks, if cyclonedds cannot be imported."""
    try:
        import cyclonedds  # noqa: F401
    except ImportError as error:
        raise InputError(f"{asker}: {MISSING_EXTRA}") from error


def topic_name(topic: str) -> str:
    """Return the name that a ROS 2 topic has in DDS: /ap/tf is rt/ap/tf."""
    return f"{_PREFIX}{topic.lstrip('/')}"


def service_names(service: str) -> tuple[str, str]:
    """Return the names that requests and replies of a ROS 2 service have in DDS: rq/ap/arm_motorsRequest, rr/..."""
    name = service.lstrip("/")
    return f"rq/{name}Request", f"rr/{name}Reply"


def check_domain(domain: int, option: str) -> None:
    """Raise InputError for a domain that there is not."""
    if not 0 <= domain <= MAX_DOMAIN:
        raise InputError(f"{option} {domain}: not a domain between 0 and {MAX_DOMAIN}")


def _policies(qos: Qos) -> Any:
    from cyclonedds.qos import Policy
    from cyclonedds.qos import Qos as CycloneQos
    from cyclonedds.util import duration

    block_ns = duration(milliseconds=0)  # a writer never waits for a reader that is slow
    return CycloneQos(
        Policy.Reliability.Reliable(block_ns) if qos.reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if qos.lasting else Policy.Durability.Volatile,
        Policy.History.KeepLast(qos.depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),  # all that ROS 2 knows
    )


class Reader(Generic[T]):
    """Reads a topic, named as ROS 2 has it. Made by ``Participant.reader``.

    It counts in ``damaged`` how many samples came that could not be read.
    """

    def __init__(self, name: str, entity: Any, descriptor: int) -> None:
        self.name = name
        self.damaged = 0
        self._entity = entity
        self._descriptor = descriptor

    def fileno(self) -> int:
        """Return the descriptor that is readable once something has come, until ``take``."""
        return self._descriptor

    def wait(self, timeout_s: float) -> bool:
        """Wait until something has come, or for some seconds; say whether it has."""
        poller = select.poll()
        poller.register(self._descriptor, select.POLLIN)
        return bool(poller.poll(timeout_s * 1e3))

    def take(self) -> list[T]:
        """Return what has come since the last time and the QoS still keeps, in its order; 100 at most."""
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._descriptor)
        taken: list[T] = []
        for _ in range(MOST_AT_ONCE):
            try:
                samples = self._entity.take(1)  # one at a time: one that cannot be read takes no other with it
            except Exception:  # from anywhere in the reading of bytes that a stranger sent
                self.damaged += 1
                continue
            if not samples:
                return taken
            if samples[0].sample_info.valid_data:
                taken.append(samples[0])
        os.eventfd_write(self._descriptor, 1)  # there may be more
        return taken

    @property
    def writers(self) -> int:
        """How many write the topic now, as far as is known."""
        return len(self._entity.get_matched_publications())


class Writer(Generic[T]):
    """Writes a topic. Made by ``Participant.writer``."""

    def __init__(self, name: str, entity: Any) -> None:
        self.name = name
        self._entity = entity

    def write(self, sample: T) -> bool:
        """Send a sample; say whether DDS took it. It is not waited for."""
        from cyclonedds.core import DDSException

        try:
            self._entity.write(sample)
        except DDSException:  # the queue is full, as a reliable reader does not keep up
            return False
        return True

    @property
    def readers(self) -> int:
        """How many read the topic now, as far as is known."""
        return len(self._entity.get_matched_subscriptions())


class Participant:
    """One member of a ROS 2 graph; ``domain`` is ROS_DOMAIN_ID.

    Raises InputError if DDS does not start, such as for want of a network.
    """

    def __init__(self, domain: int) -> None:
        from cyclonedds.core import DDSException
        from cyclonedds.domain import DomainParticipant

        try:
            self._entity: Any = DomainParticipant(domain)
        except DDSException as error:
            raise InputError(f"DDS domain {domain} cannot be entered: {error.msg or error}") from error
        self._entities: list[Any] = [self._entity]
        self._descriptors: list[int] = []
        self._publications: Any = None

    def reader(self, topic: str, message: type[T], qos: Qos) -> Reader[T]:
        """Read a topic, such as ``/ap/tf``."""
        return self._reader(topic, topic_name(topic), message, qos)

    def writer(self, topic: str, message: type[T], qos: Qos) -> Writer[T]:
        """Write a topic."""
        return self._writer(topic, topic_name(topic), message, qos)

    def server(self, service: str, request: type[T], reply: type[U]) -> tuple[Reader[T], Writer[U]]:
        """Return what reads the requests for a service, and what writes its replies.

        Both begin with the ``RequestId`` of rmw_cyclonedds, so it is clients on that who are served.
        """
        requests, replies = service_names(service)
        return self._reader(service, requests, request, DEFAULT), self._writer(service, replies, reply, DEFAULT)

    def client(self, service: str, request: type[T], reply: type[U]) -> tuple[Writer[T], Reader[U]]:
        """Return what writes requests to such a server, and what reads the replies to all of its clients."""
        requests, replies = service_names(service)
        return self._writer(service, requests, request, DEFAULT), self._reader(service, replies, reply, DEFAULT)

    def _reader(self, name: str, dds_name: str, message: type[T], qos: Qos) -> Reader[T]:
        from cyclonedds.core import Listener
        from cyclonedds.sub import DataReader

        descriptor = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._descriptors.append(descriptor)
        listener = Listener(on_data_available=lambda _reader: os.eventfd_write(descriptor, 1))
        entity = DataReader(self._entity, self._topic(dds_name, message), qos=_policies(qos), listener=listener)
        self._entities.append(entity)
        return Reader(name, entity, descriptor)

    def _writer(self, name: str, dds_name: str, message: type[T], qos: Qos) -> Writer[T]:
        from cyclonedds.pub import DataWriter

        entity = DataWriter(self._entity, self._topic(dds_name, message), qos=_policies(qos))
        self._entities.append(entity)
        return Writer(name, entity)

    def topics(self) -> dict[str, set[str]]:
        """Return the topics that somebody writes now, and the types of each, both as ROS 2 names them."""
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

        if self._publications is None:
            entity = BuiltinDataReader(self._entity, BuiltinTopicDcpsPublication)
            alive = ReadCondition(entity, SampleState.Any | ViewState.Any | InstanceState.Alive)
            self._entities += [entity, alive]
            self._publications = entity, alive
        entity, alive = self._publications
        found: dict[str, set[str]] = {}
        for one in entity.read(_MOST_WRITERS, alive):
            if one.topic_name.startswith(_PREFIX):
                kinds = found.setdefault(one.topic_name[len(_PREFIX) - 1 :], set())
                kinds.add(one.type_name.replace("::dds_::", "::").replace("::", "/").removesuffix("_"))
        return found

    def _topic(self, dds_name: str, message: type[Any]) -> Any:
        from cyclonedds.topic import Topic

        return Topic(self._entity, dds_name, message)

    def close(self) -> None:
        """Leave the graph; readers and writers end with it, and are not to be used any more."""
        for entity in self._entities:
            entity.set_listener(None)
        while self._entities:  # others may hold references, so each is closed
            self._entities.pop().__del__()
        while self._descriptors:
            os.close(self._descriptors.pop())

    def __enter__(self) -> "Participant":
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        self.close()
