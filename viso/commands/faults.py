# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso faults``: faults on a timeline, between two links or in a recorded stream."""

from contextlib import ExitStack, closing
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.live import Live

from mav_handlers.links import open_link
from viso.errors import InputError, as_input_errors
from viso.faults import FAULTS, Injector, Timeline, TimelineError, load_timeline, parse_timeline, run_through
from viso.faults.file import check_output, read_recording, write_recording
from viso.faults.proxy import FaultProxy
from viso.faults.tables import entry_table, summary_line, tally_as_dict
from viso.faults.timeline import MAX_SEED
from viso.terminal.console import err, out, progress
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal

LONGEST_S: Final = 4e9
PROGRESS_EVERY: Final = 256


def _timeline(path: Path | None, inline: list[str]) -> Timeline:
    if path is None and not inline:
        raise InputError(f"--timeline FILE or --fault TEXT is missing; faults: {', '.join(FAULTS)}")
    with as_input_errors(TimelineError):
        given = Timeline() if path is None else load_timeline(path)
        added = (parse_timeline(f"faults: [{{{text}}}]", f"--fault {text!r}") for text in inline)
        return Timeline((*given.entries, *(entry for timeline in added for entry in timeline.entries)), given.seed)


def faults(
    ends: Annotated[
        list[str],
        typer.Argument(
            help="Two links, the faulty stream goes from the first to the second; or one file.", metavar="A [B]"
        ),
    ],
    timeline: Annotated[Path | None, typer.Option(help="The faults (YAML).", metavar="FILE")] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            help="A fault as in a timeline, on one line; repeatable, after those of the file.", metavar="TEXT"
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write the stream of the file A here (.tlog, .jsonl).", metavar="OUT"),
        Output.FILE,
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of all chance, in place of the timeline's.")] = None,
    until: Annotated[
        float | None, typer.Option(help="Between links, end after this many seconds.", metavar="S")
    ] = None,
    live: Annotated[bool, typer.Option(help="Show the counts while they grow, on a terminal.")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="Print the counts as JSON.")] = False,
) -> None:
    """Put faults into a stream: as a proxy between two links, or from a recorded stream into a file.

    A and B are links as of viso serve --master. What comes from B goes to A untouched. Ctrl-C ends it, and what was
    done is shown. With -o, A is a file that viso replay reads; nothing is waited for.

    Example: seq -f '%g 0 0 -1 0 0 0 1' 0 .05 9 > poses.tum && viso faults poses.tum -o bad.tlog --fault "kind: nan"
    """
    if seed is not None and not 0 <= seed <= MAX_SEED:
        raise InputError(f"--seed {seed}: not from 0 to {MAX_SEED}")
    if until is not None and not 0 <= until <= LONGEST_S:
        raise InputError(f"--until {until:g}: not between 0 and {LONGEST_S:g}")
    chosen = _timeline(timeline, fault or [])
    injector = Injector(chosen, seed)
    console = err if as_json else out
    if output is not None:
        counts = _through_file(ends, output, injector)
    else:
        counts = _between_links(ends, injector, until, console, live=live and not as_json)
    tally = injector.tally()
    for row in tally.entries:
        if not row.done:
            err.print(f"note: entry {row.number} ({row.entry.kind}) happened to no message")
    if as_json:
        out.print_json(data={**tally_as_dict(tally), **counts})
        return
    out.print(entry_table(tally), summary_line(tally))
    for what, value in counts.items():
        out.print(f"{what.replace('_', ' ')}: {value}")


def _through_file(ends: list[str], output: Path, injector: Injector) -> dict[str, Any]:
    if len(ends) != 1:
        raise InputError(f"-o {output}: goes with one file, not with {len(ends)}")
    source = Path(ends[0])
    check_output(output, source)
    recording = read_recording(source)
    for note in recording.notes:
        err.print(f"note: {note}")
    with progress("injecting", len(recording.frames)) as show:

        def watched() -> Any:
            for number, frame in enumerate(recording.frames, 1):
                if number % PROGRESS_EVERY == 0:
                    show(number)
                yield frame

        left_out = write_recording(output, run_through(watched(), injector), recording)
    if left_out:
        err.print(f"note: {output}: {left_out} pieces that are no frame left out")
    return {"written": str(output)}


def _between_links(
    ends: list[str], injector: Injector, until_s: float | None, console: Console, *, live: bool
) -> dict[str, Any]:
    if len(ends) != 2:
        raise InputError("two links are needed, or one file and -o OUT")
    with ExitStack() as stack:
        links = [stack.enter_context(closing(open_link(name))) for name in ends]
        stop = stack.enter_context(stop_on_signal())
        console.print(f"faults from {ends[0]} to {ends[1]}; Ctrl-C ends")
        if live and console.is_terminal:
            # Drawn by a thread, which takes a copy of the counts.
            table = Live(console=console, transient=True, get_renderable=lambda: entry_table(injector.tally()))
            stack.enter_context(table)
        proxy = FaultProxy(links[0], links[1], injector, stop=lambda: bool(stop))
        proxy.run(None if until_s is None else round(until_s * 1e6))
        for link in links:
            stats = link.stats
            if stats.bytes_dropped:
                reasons = ", ".join(stats.drop_reasons)
                err.print(f"note: {link.name}: {stats.bytes_dropped} bytes could not be sent: {reasons}")
    return {"bytes_back": proxy.bytes_back, "unread_bytes": proxy.unread_bytes}
