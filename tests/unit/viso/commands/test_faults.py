# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso faults``: the proxy on a wire with a clock of its own, streams in files, and the command around both."""

import gzip
import json
import signal
from collections.abc import Callable, Iterable
from io import StringIO
from pathlib import Path

import pytest
from rich.console import Console

from mav_handlers.links import TlogWriter, read_tlog
from mav_handlers.links.base import Link
from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.links.tlog import YEAR_2000_US
from mav_handlers.wire.codec import Codec
from mav_handlers.wire.messages import HEARTBEAT
from tests.places import RECORDED
from tests.unit.viso.command_line import Viso, failed_with
from tests.unit.viso.conftest import odometry
from viso.commands import faults as faults_command
from viso.errors import InputError
from viso.faults import Injector, parse_timeline
from viso.faults import proxy as faults_proxy
from viso.faults.file import Recording, check_output, read_recording, write_recording
from viso.faults.proxy import FaultProxy

CAPTURE = RECORDED / "captures" / "mav.jsonl.gz"
BEAT = HEARTBEAT(18, 8, 0, 0, 4, 3)
SHORT = 40


class Rig:
    """A proxy between a camera and a vehicle, with a clock that moves while the proxy waits."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
        self.now_s = 100.0
        self.waits: list[float] = []
        self.on_wait: Callable[[], None] = lambda: None
        self.stopped = False
        self.camera, source = make_pair()
        self.vehicle, target = make_pair()
        self.codec = Codec(1, 197)
        self.injector = Injector(parse_timeline(f"faults: [{fault}]"))
        monkeypatch.setattr(faults_proxy, "wait_readable", self._wait)
        self.proxy = FaultProxy(source, target, self.injector, stop=lambda: self.stopped, now_s=lambda: self.now_s)

    def _wait(self, _links: Iterable[Link], timeout_s: float) -> list[Link]:
        self.waits.append(timeout_s)
        self.now_s += max(timeout_s, 1e-6)
        self.on_wait()
        return []


@pytest.fixture
def make_rig(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Rig]:
    return lambda fault: Rig(monkeypatch, fault)


MakeRig = Callable[[str], Rig]


def test_all_bytes_pass_both_ways_without_faults(make_rig: MakeRig) -> None:
    rig = make_rig("")
    there = b"noise" + rig.codec.encode(BEAT) + rig.codec.encode(odometry(1))
    back = b"whatever the vehicle says"
    rig.camera.send(there)
    rig.vehicle.send(back)
    rig.proxy.step()
    assert rig.vehicle.receive() == there
    assert rig.camera.receive() == back
    assert (rig.proxy.bytes_back, rig.proxy.unread_bytes) == (len(back), 0)


def test_faults_are_on_the_way_there_only(make_rig: MakeRig) -> None:
    rig = make_rig("{kind: blackout}")
    frame = rig.codec.encode(odometry(1))
    rig.camera.send(frame)
    rig.vehicle.send(frame)
    rig.proxy.step()
    assert rig.vehicle.receive() == b""
    assert rig.camera.receive() == frame


def test_late_frame_is_sent_when_it_is_due(make_rig: MakeRig) -> None:
    rig = make_rig("{kind: delay, delay_ms: 120}")
    frame = rig.codec.encode(odometry(1))
    rig.camera.send(frame)
    heard: list[tuple[int, bytes]] = []

    def listen() -> None:
        data = rig.vehicle.receive()
        if data:
            heard.append((round((rig.now_s - 100.0) * 1e3), data))

    rig.on_wait = listen
    rig.proxy.run(until_us=400_000)
    assert [data for _, data in heard] == [frame]
    # It came in after the first wait of 50 ms, and is heard of with the wait after the one that it ended.
    assert rig.waits[:4] == pytest.approx([0.05, 0.05, 0.05, 0.02])
    assert heard[0][0] == 220


def test_run_ends_when_told_with_what_is_held_back_counted(make_rig: MakeRig) -> None:
    rig = make_rig("{kind: delay, delay_ms: 60000}")
    rig.camera.send(rig.codec.encode(odometry(1)) + b"\xfd\x09")

    def stop() -> None:
        rig.stopped = len(rig.waits) == 3

    rig.on_wait = stop
    rig.proxy.run()
    assert len(rig.waits) == 3
    assert rig.injector.tally().waiting == 1
    assert rig.proxy.unread_bytes == 2


def test_a_peer_that_never_stops_does_not_keep_the_other_from_its_turn(make_rig: MakeRig) -> None:
    rig = make_rig("")
    frame = rig.codec.encode(BEAT)

    class Endless(PairLink):
        def receive(self, max_bytes: int = 65536) -> bytes:
            return frame

    rig.proxy = FaultProxy(
        Endless("endless"), Endless("endless"), rig.injector, stop=lambda: False, now_s=lambda: rig.now_s
    )
    rig.proxy.step()
    assert 0 < rig.injector.tally().passed_on < 1000


# Files


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """Return the first messages of a recorded capture."""
    path = tmp_path / "short.jsonl"
    with gzip.open(CAPTURE, "rt", encoding="utf-8") as file:
        path.write_text("".join(line for _, line in zip(range(SHORT + 1), file, strict=False)))
    return path


@pytest.fixture
def tlog(tmp_path: Path) -> Path:
    """Return a telemetry log of ten messages, 20 ms apart, with one stamp out of order."""
    path, codec = tmp_path / "flight.tlog", Codec(1, 197)
    with TlogWriter(path) as log:
        for number in range(10):
            time_us = number * 20_000 - (50_000 if number == 5 else 0)
            log.write(YEAR_2000_US + 1_000_000 + time_us, codec.encode(odometry(number)))
    return path


def test_telemetry_log_without_faults_stays_the_same_to_the_byte(viso: Viso, tlog: Path) -> None:
    assert viso("faults", tlog, "-o", "out.tlog", "--fault", "kind: fail, messages: HEARTBEAT").code == 0
    assert Path("out.tlog").read_bytes() == tlog.read_bytes()


def test_capture_keeps_name_and_parameters_and_can_be_replayed(viso: Viso, capture: Path) -> None:
    outcome = viso("faults", capture, "-o", "out.jsonl.gz", "--fault", "kind: duplicate, messages: all")
    assert outcome.code == 0
    replayed = json.loads(viso("replay", "out.jsonl.gz", "--json").out)
    assert replayed["stream"] == "mav"
    assert sum(row["count"] for row in replayed["verdicts"]) == 2 * SHORT


def test_capture_becomes_a_telemetry_log_with_times_of_this_century(viso: Viso, capture: Path) -> None:
    assert viso("faults", capture, "-o", "out.tlog.gz", "--fault", "kind: delay").code == 0
    first = json.loads(capture.read_text().splitlines()[1])
    entries = list(read_tlog("out.tlog.gz"))
    assert len(entries) == SHORT
    assert YEAR_2000_US <= entries[0].time_us - first["arrival_us"] <= YEAR_2000_US + 100_000


def test_message_whose_time_is_not_known_comes_with_the_one_before(tmp_path: Path) -> None:
    path, frame = tmp_path / "c.jsonl", Codec(1, 197).encode(BEAT).hex()
    lines = [{"name": "c", "params": {}}, *({"arrival_us": at, "msg": frame} for at in (None, 5, None, 9))]
    path.write_text("\n".join(map(json.dumps, lines)))
    assert [time_us for time_us, _ in read_recording(path).frames] == [5, 5, 5, 9]


def test_pieces_that_are_no_frame_are_told_when_a_log_cannot_hold_them(viso: Viso, tmp_path: Path) -> None:
    path = tmp_path / "c.jsonl"
    path.write_text('{"name": "c", "params": {}}\n{"arrival_us": 5, "msg": "0102"}\n')
    outcome = viso("faults", path, "-o", "out.tlog", "--fault", "kind: fail")
    assert outcome.code == 0
    assert "note: out.tlog: 1 pieces that are no frame left out\n" in outcome.err


def test_damage_of_a_log_is_told(viso: Viso, tlog: Path) -> None:
    data = tlog.read_bytes()
    tlog.write_bytes(data[:253] + b"junk" + data[253:-9])
    notes = read_recording(tlog).notes
    assert [note.removeprefix(f"{tlog}: ").split(",")[0] for note in notes] == [
        "4 damaged bytes passed over", "the last entry is cut short"
    ]  # fmt: skip
    told = viso("faults", tlog, "-o", "out.tlog", "--fault", "kind: quality").err
    assert told == "".join(f"note: {note}\n" for note in notes)


def test_output_that_cannot_be_is_refused(tmp_path: Path, tlog: Path) -> None:
    with pytest.raises(InputError, match=r"out\.csv: neither a telemetry log"):
        check_output(tmp_path / "out.csv", tlog)
    with pytest.raises(InputError, match=r"out\.jsonl: a telemetry log has no parameters"):
        check_output(tmp_path / "out.jsonl", tlog)
    with pytest.raises(InputError, match="No such file"):
        write_recording(tmp_path / "none" / "out.tlog", [], Recording(()))


# The command


def test_timeline_file_and_single_faults_go_together(viso: Viso, tlog: Path) -> None:
    Path("t.yaml").write_text("seed: 3\nfaults: [{kind: loss, probability: 0.5}]")
    args = (
        "faults",
        tlog,
        "-o",
        "out.tlog",
        "--timeline",
        "t.yaml",
        "--fault",
        "kind: glit, x_m: 1, at_s: 0.1",
        "--json",
    )
    first, again, other = (json.loads(viso(*args, *more).out) for more in ([], [], ["--seed", "4"]))
    assert first == again
    assert [entry["kind"] for entry in first["entries"]] == ["loss", "glit"]
    assert first["passed_on"] == 10 - first["lost"]
    assert first["received"] == {"ODOMETRY": 10}
    assert other["lost"] != first["lost"]


def test_table_tells_what_was_done_and_what_was_not(viso: Viso, tlog: Path) -> None:
    outcome = viso("faults", tlog, "-o", "out.tlog", "--fault", "kind: fail, at_s: 0.1", "--fault", "kind: degrees")
    assert "10 frames received, 0 added, 1 lost, 9 passed on; 0 changed\nwritten: out.tlog\n" in outcome.out
    assert "9 nothing in it to change" in outcome.out
    assert outcome.err == "note: entry 2 (degrees) happened to no message\n"


@pytest.mark.parametrize(("args", "complaint"), [
    (["a.tlog", "-o", "b.tlog", "--timeline", "no.yaml"], "no.yaml: No such file or directory"),
    (["a.tlog", "-o", "b.tlog", "--fault", "kind: delay, delay: 3"],
     "--fault 'kind: delay, delay: 3': entry 1 (delay): delay: unknown field; there are kind, start_s, end_s, at_s, "
     "messages, probability, delay_ms"),
    (["a.tlog", "-o", "b.tlog", "--fault", "kind: fail"], "a.tlog: no such file or directory"),
    (["a", "b", "-o", "b.tlog", "--fault", "kind: fail"], "-o b.tlog: goes with one file, not with 2"),
    (["a.tlog", "--fault", "kind: fail"], "two links are needed, or one file and -o OUT"),
    (["a", "b", "--fault", "kind: fail", "--seed", "-1"], "--seed -1: not from 0 to 9223372036854775807"),
    (["a", "b", "--fault", "kind: fail", "--until", "nan"], "--until nan: not between 0 and 4e+09"),
])  # fmt: skip
def test_what_cannot_be_used_is_one_line(viso: Viso, args: list[str], complaint: str) -> None:
    assert failed_with(viso("faults", *args), complaint)


def test_faults_are_needed_and_listed(viso: Viso) -> None:
    outcome = viso("faults", "a", "b")
    assert outcome.code == 2
    assert outcome.err.startswith("viso: --timeline FILE or --fault TEXT is missing; faults: fail, blackout, loss, ")


@pytest.fixture
def ends(monkeypatch: pytest.MonkeyPatch) -> dict[str, PairLink]:
    """Return the far ends of the links that the command opens, by their names."""
    far: dict[str, PairLink] = {}

    def open_link(name: str) -> Link:
        near, far[name] = make_pair((name, name))
        if name == "from":
            codec = Codec(1, 197)
            far[name].send(b"".join(codec.encode(odometry(number)) for number in range(4)))
        return near

    monkeypatch.setattr(faults_command, "open_link", open_link)
    return far


def test_proxy_between_links_tells_what_it_did(viso: Viso, ends: dict[str, PairLink]) -> None:
    outcome = viso("faults", "from", "to", "--until", "0.01", "--fault", "kind: loss, at_s: 0")
    assert outcome.code == 0
    assert outcome.out.startswith("faults from from to to; Ctrl-C ends\n")
    assert "4 frames received, 0 added, 1 lost, 3 passed on; 0 changed\nbytes back: 0\nunread bytes: 0\n" in outcome.out


def test_counts_are_shown_while_they_grow_on_a_terminal(
    viso: Viso, ends: dict[str, PairLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    screen = StringIO()
    monkeypatch.setattr(faults_command, "out", Console(force_terminal=True, file=screen, width=120))
    assert viso("faults", "from", "to", "--until", "0.01", "--fault", "kind: delay").code == 0
    assert screen.getvalue().count("What the faults did") >= 2


def test_signal_ends_the_proxy_in_peace(viso: Viso, ends: dict[str, PairLink], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_args: object) -> list[Link]:
        signal.raise_signal(signal.SIGINT)
        return []

    monkeypatch.setattr(faults_proxy, "wait_readable", interrupted)
    outcome = viso("faults", "from", "to", "--fault", "kind: delay", "--json")
    assert outcome.code == 0
    assert json.loads(outcome.out)["waiting"] == 4
    assert outcome.err == "faults from from to to; Ctrl-C ends\n"


def test_what_a_link_could_not_deliver_is_told(
    viso: Viso, ends: dict[str, PairLink], monkeypatch: pytest.MonkeyPatch
) -> None:
    def leave(*_args: object) -> list[Link]:
        ends["to"].close()
        return []

    monkeypatch.setattr(faults_proxy, "wait_readable", leave)
    outcome = viso("faults", "from", "to", "--until", "0.001", "--fault", "kind: quality")
    assert "note: to: " in outcome.err
    assert " bytes could not be sent: no peer\n" in outcome.err
