# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A session of odometry: through a recording, or live with a vehicle on a wire."""

import dataclasses
import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT, STATUSTEXT, Message
from tests.unit.viso.companion.sources.film_maker import write_calibration, write_film, write_inertial_csv
from viso.companion.run import session as vio_session
from viso.companion.run.log import VioLog
from viso.companion.run.session import VioSession, event_logger, printable
from viso.companion.sources.base import Recording, SourceError, SourceOptions
from viso.companion.sources.recordings import open_video
from viso.companion.strategies.klt_ransac import KltRansac
from viso.companion.vio.types import SensorEvent
from viso.errors import InputError

ALIVE = HEARTBEAT(2, 3, 0, 0, 4, 3)
SILENT = logging.Logger("test", logging.CRITICAL)


@pytest.fixture
def film(tmp_path: Path) -> Recording:
    """Return a recording of 1.2 s of standing still."""
    options = SourceOptions(
        str(write_film(tmp_path / "film.avi")),
        calibration=write_calibration(tmp_path / "small.toml"),
        imu=write_inertial_csv(tmp_path / "imu.csv", 1.3),
    )
    return open_video(options)


def session(source: Recording, **changed: Any) -> VioSession:
    fields: dict[str, Any] = {"source": source, "config": source.config, "log": VioLog(source.config)}
    return VioSession(**(fields | {"logger": SILENT, "stop": lambda: False} | changed))


def test_all_of_a_recording_is_gone_through(film: Recording) -> None:
    work = session(film)
    work.run_through()
    assert len(work.log.frames) == 12


def test_end_may_come_early(film: Recording) -> None:
    work = session(film, until_s=0.5)
    work.run_through()
    assert len(work.log.frames) == 6


def test_stop_keeps_what_was_done(film: Recording) -> None:
    log = VioLog(film.config)
    session(film, log=log, stop=lambda: len(log.frames) == 3).run_through()
    assert len(log.frames) == 3


def test_same_data_give_the_same_poses(film: Recording) -> None:
    logs = [VioLog(film.config) for _ in range(2)]
    for log in logs:
        session(film, log=log).run_through()
    first, second = (log.trajectory() for log in logs)
    assert len(first) > 3
    assert (first.positions == second.positions).all()


def test_recording_that_breaks_is_an_input_error(film: Recording) -> None:
    def data() -> Iterator[SensorEvent]:
        raise SourceError("film.avi: broken")
        yield

    with pytest.raises(InputError, match=r"film\.avi: broken"):
        session(dataclasses.replace(film, data=data)).run_through()


@pytest.fixture
def vehicle(monkeypatch: pytest.MonkeyPatch) -> PairLink:
    """Return the vehicle's end of the link that a session opens."""
    vehicle, ours = make_pair(("vehicle", "pair"))
    monkeypatch.setattr(vio_session, "open_link", lambda _name: ours)
    return vehicle


def live(work: VioSession, shown: list[str], said: tuple[Message, ...] = (), **options: Any) -> dict[str, Any]:
    return work.run_live(
        options.pop("master", "pair"),
        wait_s=options.pop("wait_s", 5.0),
        delay_s=0.0,
        alignment=None,
        show=shown.append,
    )


def say(vehicle: PairLink, *messages: Message) -> None:
    vehicle.send(b"".join(map(Codec(1, 1).encode, messages)))


def test_what_was_sent_and_said_is_told(vehicle: PairLink, film: Recording) -> None:
    say(vehicle, ALIVE, STATUSTEXT(4, "PreArm: \x1b[31mno"))
    shown: list[str] = []
    told = live(session(film, until_s=0.1), shown)
    assert told["texts"] == [{"severity": 4, "text": "PreArm: ?[31mno"}]
    assert shown == ["(4) PreArm: ?[31mno"]
    assert told["sent"]["HEARTBEAT"] == 1


def test_vehicle_that_is_not_heard_is_told_and_the_strategy_closed(
    vehicle: PairLink, film: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[KltRansac] = []
    monkeypatch.setattr(KltRansac, "close", lambda strategy: closed.append(strategy))
    with pytest.raises(InputError, match=r"--master pair: no vehicle heard within 0\.01 s \(--wait 0 sends unheard\)"):
        live(session(film), [], wait_s=0.01)
    assert len(closed) == 1


def test_server_that_refuses_is_named_as_that(film: Recording) -> None:
    with pytest.raises(InputError, match=r"tcp:127\.0\.0\.1:1: no vehicle heard within 0\.05 s: connection refused \("):
        live(session(film), [], master="tcp:127.0.0.1:1", wait_s=0.05)


def test_unheard_sending_is_possible(vehicle: PairLink, film: Recording) -> None:
    assert live(session(film, until_s=0.1), [], wait_s=0.0)["texts"] == []


def test_losses_are_told(vehicle: PairLink, film: Recording) -> None:
    vehicle.close()
    shown: list[str] = []
    live(session(film, until_s=0.1), shown, wait_s=0.0)
    assert len(shown) == 1
    assert shown[0].startswith("note: pair: ")
    assert shown[0].endswith(" bytes did not reach the vehicle: no peer")


def test_real_time_needs_no_vehicle(film: Recording) -> None:
    work = session(film, until_s=0.1)
    assert live(work, [], master=None) == {}


def test_events_are_written_as_json(tmp_path: Path, film: Recording) -> None:
    path = tmp_path / "events.jsonl"
    with event_logger(path) as logger:
        session(film, logger=logger).run_through()
    events = [json.loads(line) for line in path.read_text().splitlines()]
    assert {"vio_ready", "state_change"} <= {event["event"] for event in events}


def test_without_a_file_events_go_nowhere(film: Recording, capfd: pytest.CaptureFixture[str]) -> None:
    with event_logger(None) as logger:
        session(film, logger=logger).run_through()
    assert capfd.readouterr() == ("", "")


def test_file_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Is a directory"), event_logger(tmp_path):
        pass


def test_events_without_space_are_told_in_the_end(capfd: pytest.CaptureFixture[str]) -> None:
    logged: list[int] = []
    with pytest.raises(InputError, match="/dev/full: No space left on device"):
        log_two_events(Path("/dev/full"), logged.append)
    assert logged == [1, 2]
    assert capfd.readouterr() == ("", "")


def log_two_events(path: Path, done: Callable[[int], None]) -> None:
    with event_logger(path) as logger:
        for number in (1, 2):
            logger.info("event")
            done(number)


def test_terminal_is_not_disturbed() -> None:
    assert printable("a\x1b[2J\nb") == "a?[2J?b"
