# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso vectors``: recompute recorded firmware behaviour."""

import json
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, TextIO

import typer

from ap_visualodom.release import VisualOdomRelease
from viso.errors import InputError
from viso.files.text_files import read_lines, write_text
from viso.options.firmware import DEFAULT_FIRMWARE, FirmwareOption, firmware_of
from viso.options.outputs import Output
from viso.replay.vectors import VectorError, count_differences, parse_line, recompute
from viso.terminal.console import err, out, progress

_SHOWN_DIFFERENCES = 5


def _recomputed(path: Path, release: VisualOdomRelease) -> Iterator[tuple[int, object, object]]:
    for number, text in read_lines(path):
        try:
            line = parse_line(text)
            yield number, line, recompute(line, release)
        except VectorError as error:
            raise InputError(f"{path}:{number}: {error}") from error


def _check(path: Path, release: VisualOdomRelease) -> bool:
    outputs = differences = 0
    for number, recorded, ours in _recomputed(path, release):
        try:
            line_outputs, line_differences = count_differences(recorded, ours)
        except VectorError as error:
            raise InputError(f"{path}:{number}: {error}") from error
        outputs += line_outputs
        if line_differences and differences < _SHOWN_DIFFERENCES:
            err.print(f"{path}:{number}: {line_differences} of {line_outputs} outputs differ")
        differences += line_differences
    out.print(f"{path}: {differences} differences in {outputs} outputs")
    return differences == 0


def _write(paths: list[Path], stream: TextIO, release: VisualOdomRelease) -> None:
    with progress("recomputing", None) as bar:
        for path in paths:
            for _, _, ours in _recomputed(path, release):
                stream.write(json.dumps(ours) + "\n")
                bar.advance(bar.task_ids[0])


def vectors(
    files: Annotated[list[Path], typer.Argument(help="Recordings: .jsonl or .jsonl.gz.", metavar="FILE...")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write here (.gz compresses); default standard output."),
        Output.FILE,
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Compare with the recorded outputs and count.")] = False,
    firmware: FirmwareOption = DEFAULT_FIRMWARE,
) -> None:
    """Recompute every output of recorded firmware behaviour with the port.

    The outputs in the files are not looked at, unless --check compares them with ours; then the exit code is 1 if
    any differs.

    Example: echo '["wrap_360", ["43b48000"]]' > calls.jsonl && viso vectors calls.jsonl
    """
    release = firmware_of(firmware).visual_odom
    if check:
        if output is not None:
            raise InputError("--check writes nothing: leave out --output")
        # Every file is checked, also after one that differs.
        results = [_check(path, release) for path in files]
        if not all(results):
            raise typer.Exit(1)
        return
    with nullcontext(sys.stdout) if output is None else write_text(output) as stream:
        _write(files, stream, release)
