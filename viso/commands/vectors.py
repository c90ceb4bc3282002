# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso vectors``: recompute recorded firmware behaviour."""

import json
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from ap_visualodom.release import VisualOdomRelease
from viso.errors import InputError
from viso.files.text_files import read_lines, write_text
from viso.replay.vectors import VectorError, parse_line, recompute
from viso.terminal.console import progress
from viso.terminal.options import DEFAULT_FIRMWARE, FirmwareOption, firmware_of
from viso.terminal.outputs import Output


def _recomputed(paths: list[Path], release: VisualOdomRelease) -> Iterator[object]:
    for path in paths:
        for number, text in read_lines(path):
            try:
                yield recompute(parse_line(text), release)
            except VectorError as error:
                raise InputError(f"{path}:{number}: {error}") from error


def vectors(
    files: Annotated[list[Path], typer.Argument(help="Recordings: .jsonl or .jsonl.gz.", metavar="FILE...")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write here (.gz compresses); default standard output."),
        Output.FILE,
    ] = None,
    firmware: FirmwareOption = DEFAULT_FIRMWARE,
) -> None:
    """Recompute every output of recorded firmware behaviour with the port.

    The outputs in the files are not looked at; viso compare holds them against ours.

    Example: echo '["wrap_360", ["43b48000"]]' > calls.jsonl && viso vectors calls.jsonl
    """
    release = firmware_of(firmware).visual_odom
    with (
        nullcontext(sys.stdout) if output is None else write_text(output) as stream,
        progress("recomputing", None) as show,
    ):
        for done, ours in enumerate(_recomputed(files, release), 1):
            stream.write(json.dumps(ours) + "\n")
            show(done)
