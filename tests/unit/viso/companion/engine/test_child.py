# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that are no good engines: each is told in a line, within its time, and nothing of it is left."""

import contextlib
import gc
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.viso.companion.engine.compiled import descriptors, has_ended, inertial_engine
from viso.companion.engine.child import MOST_COLUMNS, MOST_LINES, MOST_MESSAGES, EngineChild, EngineFailure
from viso.companion.engine.protocol import Failure, Hello, Log, Message, frame_of, nothing

SHORT_S = 0.05
AMPLE_S = 20.0
HELLO = Hello(**nothing(Hello))


class Rig:
    """Programs of a shell, and what they let be logged."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.lines, self.pids = folder, list[tuple[int | None, str]](), list[int]()

    def sends(self, *messages: Message, repeat: int = 1) -> str:
        """Return the shell's command that sends messages."""
        file = self.folder / f"{len(list(self.folder.iterdir()))}.bin"
        file.write_bytes(b"".join(frame_of(message) for message in messages) * repeat)
        return f"cat {shlex.quote(str(file))}"

    def child(self, script: str) -> EngineChild:
        child = EngineChild(f"sh -c {shlex.quote(script)}", lambda level, text: self.lines.append((level, text)))
        self.pids.append(child.pid)
        return child

    @contextlib.contextmanager
    def running(self, script: str) -> Iterator[EngineChild]:
        child = self.child(script)
        try:
            yield child
        finally:
            child.close(grace_s=0)

    def fails(self, script: str, timeout_s: float = AMPLE_S) -> tuple[str, str]:
        """Run a script, and return how it fails to say hello: the kind and the text."""
        with self.running(script) as child, pytest.raises(EngineFailure) as caught:
            child.exchange([], Hello, timeout_s)
        assert len(str(caught.value).splitlines()) == 1
        return caught.value.kind, str(caught.value)


def shared_memory() -> list[str]:
    """Return what there is of it on the machine, but for the semaphores of other tests' processes."""
    return sorted(name for name in os.listdir("/dev/shm") if not name.startswith("sem."))


@pytest.fixture(scope="module", autouse=True)
def forgotten_elsewhere() -> None:
    """Close what tests of other modules have forgotten, and then let only what is new be collected."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    """Yield a rig, and see that nothing is left in the end."""
    before, memory = descriptors(), shared_memory()
    rig = Rig(tmp_path)
    yield rig
    assert descriptors() == before
    assert shared_memory() == memory
    assert all(has_ended(pid) for pid in rig.pids)


@pytest.mark.parametrize(
    ("script", "kind", "text"),
    [
        ("exit 3", "exits", "ended with exit code 3"),
        ("echo no licence >&2; exit 1", "exits", "ended with exit code 1: no licence"),
        ("kill -SEGV $$", "exits", "ended by signal 11 (Segmentation fault)"),
        ("echo hello; exec sleep 100", "protocol_errors", r"no message: b'hello\n'"),
        ("exec yes VISEnough", "protocol_errors", "message of unknown kind 1735749486"),
        ("exec cat /dev/zero", "protocol_errors", f"no message: {bytes(16)!r}"),
        ("exec 1>&-; exec sleep 100", "exits", "closed its output"),
        (
            "printf 'VISE\\145\\0\\0\\0\\377\\377\\377\\377'; exec sleep 100",
            "protocol_errors",
            "Hello of 4294967295 bytes",
        ),
    ],
)
def test_failure_is_told_in_a_line(rig: Rig, script: str, kind: str, text: str) -> None:
    assert rig.fails(script) == (kind, text)


@pytest.mark.parametrize("script", ["exec sleep 100", "printf VISE; exec sleep 100", "yes noise >&2"])
def test_silence_ends_with_the_time(rig: Rig, script: str) -> None:
    assert rig.fails(script, SHORT_S) == ("hangs", f"no Hello within {SHORT_S} s")


@pytest.mark.parametrize("command", ["/nowhere/engine", "", "'", "/etc/passwd"])
def test_what_cannot_be_started_is_told(rig: Rig, command: str) -> None:
    with pytest.raises(EngineFailure, match=rf"^{command}: [\w ]+$"):
        EngineChild(command, print)


def test_failure_in_its_own_words(rig: Rig) -> None:
    assert rig.fails(rig.sends(Failure(text=b"no\nvocabulary"))) == ("failures", "no vocabulary")


def test_answer_and_what_came_before_it(rig: Rig) -> None:
    with rig.running(rig.sends(Log(level=30, text=b"soon"), HELLO) + "; exec sleep 100") as child:
        before, answer = child.exchange([], Hello, AMPLE_S)
    assert [type(one) for one in before] == [Log]
    assert isinstance(answer, Hello)
    assert rig.lines == [(30, "soon")]


def test_messages_without_an_end_are_a_flood(rig: Rig) -> None:
    flood = rig.sends(Log(level=10, text=b"x"), repeat=2 * MOST_MESSAGES)
    assert rig.fails(f"{flood}; exec sleep 100") == ("protocol_errors", f"more than {MOST_MESSAGES} messages at once")


def test_lines_of_standard_error_are_told_up_to_a_number(rig: Rig) -> None:
    count = 4 * MOST_LINES
    script = f"seq {count} >&2; printf '%-5000s\\n' long >&2; {rig.sends(HELLO)}; exec sleep 100"
    with rig.running(script) as child:
        child.exchange([], Hello, AMPLE_S)
        assert child.dropped_lines == count + 1 - MOST_LINES
    assert rig.lines == [(None, str(number)) for number in range(1, MOST_LINES + 1)]
    assert MOST_COLUMNS < 5000


def test_program_that_does_not_read_ends_with_the_time(rig: Rig) -> None:
    with rig.running("exec sleep 100") as child, pytest.raises(EngineFailure, match="no Hello within"):
        child.exchange([bytes(10_000_000)], Hello, SHORT_S)


def test_answer_ahead_of_the_question_is_none(rig: Rig) -> None:
    with rig.running(f"{rig.sends(HELLO, HELLO)}; exec sleep 100") as child:
        child.exchange([], Hello, AMPLE_S)
        with pytest.raises(EngineFailure, match=r"^Hello ahead of what it answers$"):
            child.exchange([bytes(10_000_000)], Hello, AMPLE_S)


def test_program_that_closes_its_input_is_not_waited_for(rig: Rig) -> None:
    with rig.running(f"exec 0<&-; {rig.sends(HELLO)}; exec sleep 100") as child:
        child.exchange([], Hello, AMPLE_S)
        with pytest.raises(EngineFailure, match="no Hello within"):
            child.exchange([bytes(100_000)], Hello, SHORT_S)


def test_what_it_has_started_ends_with_it(rig: Rig) -> None:
    pids = rig.folder / "pids"
    with rig.running(f"sleep 100 & echo $! >{pids}; {rig.sends(HELLO)}; exit 0") as child:
        child.exchange([], Hello, AMPLE_S)
    rig.pids.append(int(pids.read_text()))


def test_closed_twice_is_closed(rig: Rig) -> None:
    child = rig.child("exec cat")
    child.close()
    child.close()


def test_forgotten_is_closed(rig: Rig) -> None:
    child = rig.child("exec sleep 100")
    child.share(100)
    child.put(bytes(100))
    del child
    gc.collect()


def test_memory_cannot_be_cut_off(rig: Rig) -> None:
    with rig.running("exec sleep 100") as child:
        memory = child.share(100)
        assert memory is not None
        with pytest.raises(PermissionError):
            os.ftruncate(memory.descriptor, 10)


COMPANION = """
import os, signal, sys
from viso.companion.engine.child import EngineChild
child = EngineChild(sys.argv[1], print)
print(child.pid, flush=True)
{end}
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "end",
    [
        "os.kill(os.getpid(), signal.SIGKILL)",
        "os.kill(os.getpid(), signal.SIGTERM)",
        "raise RuntimeError",
        "signal.signal(signal.SIGINT, signal.default_int_handler); signal.raise_signal(signal.SIGINT)",
        "os._exit(0)",
    ],
)
def test_engine_ends_with_the_companion(rig: Rig, end: str) -> None:
    script = [sys.executable, "-c", COMPANION.format(end=end), inertial_engine()]
    done = subprocess.run(script, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert has_ended(int(done.stdout))
