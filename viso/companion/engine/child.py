# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The process of an engine: start, exchange of messages within a time limit, and a safe end.

The process has its own process group, which is killed when the engine fails or is closed, or this program ends. If this
program is killed, the engine's input ends. Pictures lie in anonymous shared memory, which the system frees after its
last user. Every wait has a limit.
"""

import contextlib
import fcntl
import mmap
import os
import select
import shlex
import signal
import subprocess
import time
import weakref
from collections import deque
from collections.abc import Callable, Iterable
from typing import IO, Final, cast

from viso.companion.engine.protocol import FROM_ENGINE, Decoder, Failure, Log, M, Message, ProtocolError, SharedMemory

READ_BYTES: Final = 65536
MOST_MESSAGES: Final = 1000
"""The most messages before an answer; more are treated as a flood."""
MOST_LINES: Final = 50
"""The most lines of standard error logged per exchange; further lines are only counted."""
MOST_COLUMNS: Final = 300
EXIT_S: Final = 0.2
"""The longest wait for the exit of a process that closed its output or whose input has ended."""


class EngineFailure(Exception):
    """A program that has failed; the text is one line.

    Attributes:
        kind: ``exits``, ``hangs``, ``protocol_errors`` or ``failures`` (which it reported itself).
    """

    def __init__(self, kind: str, text: str) -> None:
        super().__init__(text)
        self.kind = kind


OnLine = Callable[[int | None, str], object]
"""Takes a line for the log: its level, None for one of standard error, and the text."""


class EngineChild:
    """An engine's process.

    Args:
        command: as in a shell, without its substitutions.
    """

    def __init__(self, command: str, on_line: OnLine) -> None:
        self._on_line = on_line
        self._decoder = Decoder(FROM_ENGINE)
        self._inbox = deque[Message]()
        self._lines = _Lines(lambda line: on_line(None, line))
        self._memory_fd = _memory_fd()
        self._memory: mmap.mmap | None = None
        try:
            words = shlex.split(command) or [""]
            self._process = subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                bufsize=0,
                start_new_session=True,
                pass_fds=() if self._memory_fd is None else (self._memory_fd,),
            )
        except (OSError, ValueError) as error:
            _close_fd(self._memory_fd)
            raise EngineFailure("exits", f"{command}: {getattr(error, 'strerror', None) or error}") from error
        self._stdin, self._stdout, self._stderr = (
            cast(IO[bytes], pipe).fileno() for pipe in (self._process.stdin, self._process.stdout, self._process.stderr)
        )
        for fd in (self._stdin, self._stdout, self._stderr):
            os.set_blocking(fd, False)
        self._end = weakref.finalize(self, _end, self._process, self._memory_fd)

    @property
    def pid(self) -> int:
        """The id of its process, which leads a process group."""
        return self._process.pid

    @property
    def dropped_lines(self) -> int:
        """The number of lines of standard error that were not logged."""
        return self._lines.dropped

    def share(self, size: int) -> SharedMemory | None:
        """Set the size of the shared memory in bytes, once; return the message about it, None without such memory."""
        if self._memory_fd is None:
            return None
        os.ftruncate(self._memory_fd, size)
        # If the engine truncated the memory, a write would be a bus error here.
        fcntl.fcntl(self._memory_fd, fcntl.F_ADD_SEALS, fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_SEAL)
        self._memory = mmap.mmap(self._memory_fd, size)
        return SharedMemory(size=size, descriptor=self._memory_fd, zero=0)

    def put(self, pixels: bytes) -> None:
        """Write to the start of the shared memory."""
        assert self._memory is not None
        self._memory[: len(pixels)] = pixels

    def exchange(self, frames: Iterable[bytes], until: type[M], timeout_s: float) -> tuple[list[Message], M]:
        """Send frames, and return the messages before the answer, and the answer.

        Raises:
            EngineFailure: if the answer does not come in time, or the output is not a message.
        """
        deadline_s = time.monotonic() + timeout_s
        pending, before = memoryview(b"".join(frames)), list[Message]()
        self._lines.begin()
        while True:
            while self._inbox:
                message = self._inbox.popleft()
                if isinstance(message, until):
                    if pending:
                        raise EngineFailure("protocol_errors", f"{until.__name__} ahead of what it answers")
                    self._read_errors()
                    return before, message
                self._take(message, before)
            left_s = deadline_s - time.monotonic()
            if left_s <= 0:
                raise EngineFailure("hangs", f"no {until.__name__} within {timeout_s:g} s")
            pending = self._step(pending, left_s)

    def _take(self, message: Message, before: list[Message]) -> None:
        if isinstance(message, Failure):
            raise EngineFailure("failures", _one_line(message.text))
        if isinstance(message, Log):
            self._on_line(message.level, _one_line(message.text))
        before.append(message)
        if len(before) > MOST_MESSAGES:
            raise EngineFailure("protocol_errors", f"more than {MOST_MESSAGES} messages at once")

    def _step(self, pending: memoryview, wait_s: float) -> memoryview:
        """Wait until something can be read or written, and do it; return the bytes still to be written."""
        poll = select.poll()
        poll.register(self._stdout, select.POLLIN)
        poll.register(self._stderr, select.POLLIN if self._lines.is_open else 0)
        if pending:
            poll.register(self._stdin, select.POLLOUT)
        ready = {fd for fd, _ in poll.poll(max(1, wait_s * 1000))}
        if self._stderr in ready:
            self._read_errors()
        if self._stdout in ready:
            self._read()
        if pending and self._stdin in ready:
            with contextlib.suppress(BlockingIOError):
                try:
                    return pending[os.write(self._stdin, pending) :]
                except BrokenPipeError:  # its output ends soon, or it stays silent
                    return memoryview(b"")
        return pending

    def _read(self) -> None:
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._stdout, READ_BYTES)
            if not data:
                raise EngineFailure("exits", self._how_it_ended())
            try:
                self._inbox.extend(self._decoder.feed(data))
            except ProtocolError as error:
                raise EngineFailure("protocol_errors", str(error)) from error

    def _read_errors(self) -> None:
        with contextlib.suppress(BlockingIOError):
            self._lines.take(os.read(self._stderr, READ_BYTES) if self._lines.is_open else b"")

    def _how_it_ended(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(EXIT_S)
        self._read_errors()
        code, last = self._process.returncode, f": {self._lines.last}" if self._lines.last else ""
        if code is None:
            return f"closed its output{last}"
        name = signal.strsignal(-code) if code < 0 else None
        return f"ended by signal {-code} ({name}){last}" if code < 0 else f"ended with exit code {code}{last}"

    def close(self, *, grace_s: float = EXIT_S) -> None:
        """End the process and its children.

        Args:
            grace_s: the longest wait for its own exit after its input has ended.
        """
        if self._end.alive and grace_s > 0 and self._process.returncode is None:
            cast(IO[bytes], self._process.stdin).close()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(grace_s)
        if self._memory is not None:
            self._memory.close()
            self._memory = None
        self._end()


class _Lines:
    """Splits standard error into lines, and limits their number."""

    def __init__(self, on_line: Callable[[str], object]) -> None:
        self._on_line, self._rest, self._logged = on_line, b"", 0
        self.is_open, self.last, self.dropped = True, "", 0

    def begin(self) -> None:
        """Reset the limit on logged lines."""
        self._logged = 0

    def take(self, data: bytes) -> None:
        """Add bytes; empty bytes mark the end."""
        self.is_open = bool(data)
        *lines, rest = (self._rest + (data or b"\n")).split(b"\n")
        self._rest = rest[:MOST_COLUMNS]
        for line in lines:
            if text := _one_line(line[:MOST_COLUMNS]):
                self.last = text
                self._logged += 1
                if self._logged > MOST_LINES:
                    self.dropped += 1
                else:
                    self._on_line(text)


def _one_line(data: bytes) -> str:
    text = data.decode(errors="replace").strip()
    return "".join(character if character.isprintable() else " " for character in text)


def _memory_fd() -> int | None:
    """Return the descriptor of anonymous memory, or None if the system does not support it."""
    if not hasattr(os, "memfd_create"):
        return None
    try:
        return os.memfd_create("viso-engine", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    except OSError:
        return None


def _close_fd(fd: int | None) -> None:
    if fd is not None:
        os.close(fd)


def _end(process: "subprocess.Popen[bytes]", memory_fd: int | None) -> None:
    with contextlib.suppress(ProcessLookupError, PermissionError):  # its children may outlive it
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for pipe in (process.stdin, process.stdout, process.stderr):
        cast(IO[bytes], pipe).close()
    _close_fd(memory_fd)
