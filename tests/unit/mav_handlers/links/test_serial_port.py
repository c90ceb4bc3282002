# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Serial ports, on pseudo-terminals."""

import errno
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mav_handlers.links import Link, LinkError, open_link
from mav_handlers.links.serial_port import SerialLink

Collect = Callable[[Link, int], bytes]
Until = Callable[[Callable[[], bool], Link], None]


class Clock:
    now_s = 10.0

    def __call__(self) -> float:
        return self.now_s


class Cable:
    """A device name that leads to one pseudo-terminal after another."""

    def __init__(self, device: Path) -> None:
        self.device = device
        self.master = -1
        self._slave = -1

    def plug(self) -> None:
        self.master, self._slave = os.openpty()
        os.set_blocking(self.master, False)
        self.device.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        self.device.unlink(missing_ok=True)
        for fd in (self.master, self._slave):
            if fd >= 0:
                os.close(fd)
        self.master = self._slave = -1


@pytest.fixture
def cable(tmp_path: Path) -> Iterator[Cable]:
    made = Cable(tmp_path / "ttyUSB0")
    made.plug()
    yield made
    made.unplug()


def test_missing_device_is_an_error_in_one_line(tmp_path: Path) -> None:
    name = f"{tmp_path}/ttyUSB7,57600"
    with pytest.raises(LinkError) as caught:
        open_link(name)
    assert str(caught.value) == f"cannot open {name}: no such file or directory"


def test_file_that_is_no_terminal_is_an_error_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("text")
    with pytest.raises(LinkError, match=r"\Acannot open [^\n]+\Z"):
        open_link(str(path))


def test_port_that_another_program_holds_is_an_error_in_one_line(cable: Cable) -> None:
    first = open_link(str(cable.device))
    with pytest.raises(LinkError) as caught:
        open_link(str(cable.device))
    assert str(caught.value) == f"cannot open {cable.device}: another program has opened this port"
    first.close()


def test_rate_is_set_on_the_port_and_told_to_the_transport_model(cable: Cable) -> None:
    link = open_link(f"{cable.device},921600")
    assert link.baud == 921600
    link.close()


def test_device_name_may_contain_a_colon(tmp_path: Path) -> None:
    cable = Cable(tmp_path / "usb-1:2")
    cable.plug()
    link = open_link(f"{cable.device}")
    assert link.name == str(cable.device)
    link.close()
    cable.unplug()


def test_unplugged_port_is_a_disconnect_and_sends_are_counted(cable: Cable, until: Until) -> None:
    link = SerialLink("x", str(cable.device), 57600, monotonic=Clock())
    cable.unplug()
    until(lambda: link.receive() == b"" and link.stats.disconnects == 1, link)
    link.send(b"lost")
    assert link.stats.drop_reasons == {"no peer": 1}
    assert link.fileno() == -1
    link.close()


def test_port_is_opened_again_when_it_is_back(cable: Cable, until: Until, collect: Collect) -> None:
    clock = Clock()
    link = SerialLink("x", str(cable.device), 57600, monotonic=clock)
    cable.unplug()
    until(lambda: link.receive() == b"" and link.stats.disconnects == 1, link)
    clock.now_s += 0.25
    link.receive()
    assert link.stats.open_failures == 1
    cable.plug()
    link.receive()
    assert link.stats.connects == 1  # not yet its time
    clock.now_s += 0.5
    link.receive()
    assert link.stats.connects == 2
    os.write(cable.master, b"back")
    assert collect(link, 4) == b"back"
    link.close()


def test_backlog_of_a_port_that_takes_nothing_is_bounded(cable: Cable) -> None:
    link = open_link(f"{cable.device}")
    for _ in range(100):
        link.send(bytes(4096))
    stats = link.stats
    assert stats.drop_reasons["backlog full"] > 0
    assert 100 * 4096 - stats.bytes_out - stats.bytes_dropped <= 65536
    link.close()
    assert link.stats.bytes_out + link.stats.bytes_dropped == 100 * 4096


def test_rate_that_the_port_refuses_is_an_error_in_one_line(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(self: SerialLink) -> None:
        raise OSError(errno.EINVAL, "")

    monkeypatch.setattr(SerialLink, "_open_port", refuse)
    with pytest.raises(LinkError, match=r"\Acannot open [^\n]+: invalid argument\Z"):
        open_link(f"{cable.device},12345678")
