# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the commands share on the terminal: tables, progress, notes."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import IO, Any, Final

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Column, Table
from rich.text import Text

from ap_core.verdict import Rule, VerdictKind
from mav_handlers.verdicts import ALL_VERDICTS
from viso.extras import pip_install
from viso.terminal.process import printable

PLOT_HINT: Final = f"no plot: matplotlib is missing; install it with: {pip_install('plot')}"

_STYLES = {
    VerdictKind.ACCEPTED: "green",
    VerdictKind.IGNORED: "yellow",
    VerdictKind.DROPPED: "red",
    VerdictKind.HANDLED: "",
}
_RULES: dict[str, Rule] = {verdict.rule.code: verdict.rule for verdict in ALL_VERDICTS}

VerdictCounts = Mapping[tuple[str, VerdictKind, str], int]


class _PlainConsole(Console):
    """A console that prints printable text only, and leaves a closed pipe to the command line."""

    @property
    def file(self) -> IO[str]:
        """The stream, which is to take the console's own escapes as they are."""
        return getattr(super().file, "rich_proxied_file", super().file)

    @file.setter
    def file(self, new_file: IO[str]) -> None:
        self._file = new_file

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the pieces of something to print."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=printable(segment.text))

    def print_json(self, *args: Any, **options: Any) -> None:
        """Print JSON in ASCII, which has escapes of its own."""
        super().print_json(*args, ensure_ascii=True, **options)

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


out = _PlainConsole(highlight=False, markup=False, emoji=False, soft_wrap=True)
err = _PlainConsole(highlight=False, markup=False, emoji=False, soft_wrap=True, stderr=True)


def reason_of(code: str) -> str:
    """Return the sentence of a rule by its code."""
    return _RULES[code].text


def verdict_table(counts: VerdictCounts) -> Table:
    """Return a table of how often each message type met each verdict; bad bytes are counted as bytes."""
    table = Table("message", Column("count", justify="right"), "verdict", "why", title="Outcome of each message")
    for (name, outcome, code), count in sorted(counts.items()):
        unit = f"{count} bytes" if name == "BAD_DATA" else str(count)
        table.add_row(name, unit, Text(outcome.value, style=_STYLES[outcome]), reason_of(code))
    return table


def verdict_rows(counts: VerdictCounts) -> list[dict[str, object]]:
    """Return the same counts for machine-readable output."""
    return [
        {"message": name, "outcome": outcome.value, "rule": code, "reason": reason_of(code), "count": count}
        for (name, outcome, code), count in sorted(counts.items())
    ]


@contextmanager
def progress(title: str, total: int | None) -> Iterator[Callable[..., None]]:
    """Show progress on standard error, if that is a terminal; yield a function of what is done, and of the total."""
    # Imported by those who wait: it makes every other command start slower.
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(title, total=total)

        def show(done: float, total: float | None = None) -> None:
            bar.update(task, completed=done, total=total)

        yield show


@contextmanager
def drawing(hint: str = PLOT_HINT) -> Iterator[None]:
    """Print a hint if matplotlib is missing where a picture is drawn."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or not error.name.startswith(("matplotlib", "PIL")):
            raise
        err.print(hint)
