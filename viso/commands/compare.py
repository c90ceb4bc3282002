# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso compare``: recordings of an autopilot compared with viso."""

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Final

import typer

from viso.compare.comparison import Comparison
from viso.compare.outputs import Comparisons, field_table, firmware_table, make_page, summary_table
from viso.compare.recordings import compare_recording, compare_with_all, most_like, recordings_in
from viso.errors import InputError, file_errors
from viso.extras import installed_version
from viso.files.text_files import write_text
from viso.firmware.releases import PROFILES, Firmware
from viso.recording.driving import MASTER_HELP, record_at
from viso.recording.outputs import write_recording
from viso.recording.scenario import read_scenario
from viso.replay.ekf.run import NothingToCompare
from viso.terminal.console import err, out, progress
from viso.terminal.options import firmware_of
from viso.terminal.outputs import Output
from viso.terminal.process import stop_on_signal

_FINDINGS: Final = 1


def compare(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help="Captures, conversations and vectors (.jsonl), logs with replay records (.BIN, packed or not), "
            "or folders of them; with --master the scenarios to record, as of viso record.",
            metavar="RECORDING...",
        ),
    ],
    firmware: Annotated[
        str | None,
        typer.Option(
            help=f"The firmware to be: {', '.join(PROFILES)}; default the one that a recording names, else what "
            "it is most like.",
            metavar="PROFILE",
        ),
    ] = None,
    master: Annotated[
        str | None, typer.Option(help=f"Record first, and compare that. {MASTER_HELP}", metavar="LINK")
    ] = None,
    keep: Annotated[
        Path | None,
        typer.Option(help="With --master: the folder for what is recorded; else it is not kept.", metavar="DIR"),
        Output.PLACE,
    ] = None,
    which: Annotated[
        bool, typer.Option("--which", help="Show which firmware the recordings are most like, by trying all.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the comparisons as JSON.")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Write a page here.", metavar="FILE.html"), Output.FILE
    ] = None,
) -> None:
    """Play recordings of an autopilot through viso, and report which fields differ.

    What a recording holds beside its messages is compared: records, texts, acknowledgements, answers, or what the
    filter estimated. Floats have to be equal bit by bit, but for the tolerances that docs/parity.md lists with their
    reasons. A capture whose backend aligns to the AHRS takes the attitude from the log of the same name beside it.

    With --master scenarios are played to an autopilot and recorded, and that is compared: my autopilot against viso.

    The exit code is 1 if anything differs, or a recording is incomplete; with --which, if no firmware makes all
    recordings equal.

    Example: echo '["wrap_360", ["43b48000"], ["3f800000"]]' > calls.jsonl && viso compare calls.jsonl
    """
    if which and firmware is not None:
        raise InputError("--which and --firmware: use one of the two")
    chosen = None if firmware is None else firmware_of(firmware)
    if keep is not None and master is None:
        raise InputError("--keep: only with --master is anything recorded")
    whole = True
    with ExitStack() as stack:
        if master is not None:
            folder = keep or Path(stack.enter_context(TemporaryDirectory()))
            taken = [_recorded(str(name), master, folder) for name in recordings]
            recordings, whole = [place for place, _ in taken], all(is_whole for _, is_whole in taken)
        found = _compare_all(recordings, chosen, which=which)
    nearest = sorted(most_like(found), key=lambda name: name not in _named(found)) if which else []
    # The comparison under the profile nearest to all recordings, or the only one.
    shown = [comparisons[nearest[0]] if nearest else next(iter(comparisons.values())) for comparisons in found]
    if as_json:
        rows = [comparison.as_dict() for comparisons in found for comparison in comparisons.values()]
        like = {"most_like": nearest} if which else {}
        out.print_json(data={"passed": all(comparison.passed for comparison in shown), "comparisons": rows, **like})
    else:
        _print(shown)
        if which:
            _print_which(found, nearest)
    if output is not None:
        with write_text(output) as file:
            file.write(
                make_page(
                    [comparison for comparisons in found for comparison in comparisons.values()], installed_version()
                )
            )
    if not (whole and all(comparison.passed for comparison in shown)):
        raise typer.Exit(_FINDINGS)


def _recorded(scenario_name: str, master: str, folder: Path) -> tuple[Path, bool]:
    """Record a scenario into a new folder; return the folder, and whether the recording is complete."""
    scenario = read_scenario(scenario_name)
    place = folder / scenario.name
    with file_errors(f"--keep {folder}"):
        place.mkdir(parents=True, exist_ok=True)
    with stop_on_signal() as stop:
        recording = record_at(master, scenario, lambda: len(stop), on_progress=err.print)
    write_recording(place, recording)
    for problem in recording.problems:
        err.print(f"incomplete: {scenario.name}: {problem}")
    return place, not recording.problems


def _compare_all(recordings: list[Path], chosen: Firmware | None, *, which: bool) -> list[Comparisons]:
    paths = list(recordings_in(recordings))
    found: list[Comparisons] = []
    for number, (path, of_folder) in enumerate(paths, 1):
        try:
            found.append(_compared(path, chosen, f"{number} of {len(paths)}: {path.name}", which=which))
        except NothingToCompare as error:
            if not of_folder:
                raise
            err.print(f"note: passed over: {error}")
    if not found:
        raise InputError(f"{recordings[0]}: nothing to compare with")
    return found


def _compared(path: Path, chosen: Firmware | None, title: str, *, which: bool) -> Comparisons:
    with progress(title, None) as show:
        if which:
            return compare_with_all(path, show)
        comparison = compare_recording(path, chosen, show)
        return {comparison.firmware: comparison}


def _print(comparisons: list[Comparison]) -> None:
    out.print(summary_table(comparisons))
    for comparison in comparisons:
        out.print(f"{comparison.path}: {comparison.judged_as}")
        for note in comparison.notes:
            err.print(f"note: {comparison.path}: {note}")
        if not comparison.passed:
            out.print(field_table(comparison))


def _print_which(found: list[Comparisons], nearest: list[str]) -> None:
    out.print(firmware_table(found))
    named = _named(found)
    of_names = f" (they say that they are of {', '.join(named)})" if named else ""
    out.print(f"most like {' and '.join(nearest)}{of_names}")
    if len(nearest) > 1:
        err.print("note: these recordings are the same in all of them; record a conversation as well")


def _named(found: list[Comparisons]) -> list[str]:
    """Return the profiles that the recordings name."""
    return list(
        dict.fromkeys(
            comparison.named for comparisons in found for comparison in comparisons.values() if comparison.named
        )
    )
