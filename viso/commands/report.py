# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""``viso report``: what a flight's log holds about external navigation."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from viso.errors import InputError, file_errors
from viso.extras import installed_version, pip_install
from viso.files.outputs import output_file, refuse_input
from viso.firmware.releases import Firmware
from viso.report.exports import csv_text, mcap_bytes, trajectories, tum_text
from viso.report.facts import Facts, facts_of
from viso.report.flight_data import Material, read_material
from viso.report.summary import Summary, summarise
from viso.terminal.console import err, out, progress
from viso.terminal.options import RecordedFirmwareOption, firmware_of
from viso.terminal.outputs import Output

_MISSING_EXTRA: Final = f"figures are drawn with matplotlib; install it with: {pip_install('plot')}"
_PDF: Final = ".pdf"
_PAGES: Final = (".html", ".htm", _PDF)


def report(
    log: Annotated[Path, typer.Argument(help="A DataFlash log (.BIN, packed or not).", metavar="LOG")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="The page, if it ends in .html or .pdf; else the folder that it goes to."),
        Output.PLACE,
    ] = None,
    png: Annotated[
        Path | None, typer.Option(help="Write each figure here as PNG.", metavar="DIR"), Output.PLACE
    ] = None,
    svg: Annotated[
        Path | None, typer.Option(help="Write each figure here as SVG.", metavar="DIR"), Output.PLACE
    ] = None,
    tum: Annotated[
        Path | None,
        typer.Option(help="Write the trajectories here, as FILE_vision.tum and FILE_ekf.tum.", metavar="FILE.tum"),
        Output.PLACE,
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(help="Write vision beside the EKF here.", metavar="FILE.csv"), Output.PLACE
    ] = None,
    mcap: Annotated[
        Path | None, typer.Option(help="Write both trajectories here.", metavar="FILE.mcap"), Output.PLACE
    ] = None,
    web: Annotated[
        str | None,
        typer.Option(help="Show the log on the page of the live view, with a slider.", metavar="[HOST:]PORT"),
    ] = None,
    firmware: RecordedFirmwareOption = None,
) -> None:
    """Report what a flight's log holds about external navigation, as a page with figures.

    The log may be of ArduPilot or of viso. Without any option the page is written to the current folder, under the
    name of the log. It needs no other file and no network. Records that the log does not have are named, and are no
    error. Parameters are compared with the defaults of --firmware. Figures take the extra plot, MCAP takes the extra
    bags, --web the extra web.

    Example: viso demo --camera simulated && viso report logs/00000001.BIN --tum flight.tum
    """
    if output is None and all(place is None for place in (png, svg, tum, csv, mcap, web)):
        output = Path()
    chosen = None if firmware is None else firmware_of(firmware)
    page = None if output is None else _page_path(output, log)
    if page is not None:
        refuse_input(page)
    wants_figures = page is not None or png is not None or svg is not None
    if wants_figures:
        _check_figures()
    material, facts, summary = _read(log, chosen)
    written_files = [_write(path, data) for path, data in _exports(material, tum, csv, mcap)]
    if wants_figures:
        written_files += _draw(material, facts, summary, page, png, svg)
    out.print(f"{summary.level.badge.upper()}: {summary.sentence}")
    out.print(str(facts.judged_by))
    for remark in summary.remarks:
        out.print(f"- {remark.text}")
    for path in written_files:
        out.print(f"written: {path}")
    if web is not None:
        # Imported only when needed: the server is slow to import.
        from viso.web.flight_log import log_recording
        from viso.web.live_view import show_recording

        show_recording(web, log_recording(material, facts, summary), err.print)


def _page_path(output: Path, log: Path) -> Path:
    if output.suffix.lower() in _PAGES and not output.is_dir():
        return output
    stem = log.name.removesuffix(".xz")
    return output / (Path(stem).stem + ".html")


def _read(log: Path, chosen: Firmware | None) -> tuple[Material, Facts, Summary]:
    with progress("reading", 100) as show:
        material = read_material(log, show)
    facts = facts_of(material, chosen)
    for note in (*material.lost, *facts.judged_by.notes):
        err.print(f"note: {log}: {note}")
    return material, facts, summarise(material, facts)


def _write(path: Path, data: bytes) -> Path:
    with file_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with output_file(path) as file:
        file.write(data)
    return path


def _exports(material: Material, tum: Path | None, csv: Path | None, mcap: Path | None) -> Iterator[tuple[Path, bytes]]:
    if tum is not None:
        found = trajectories(material)
        if not found:
            err.print(f"note: --tum {tum}: the log has no trajectory, nothing was written")
        for name, poses in found.items():
            yield tum.with_name(f"{tum.stem}_{name}{tum.suffix or '.tum'}"), tum_text(poses).encode()
    if csv is not None:
        yield csv, csv_text(material).encode()
    if mcap is not None:
        with progress("writing MCAP", None) as show:
            data = mcap_bytes(material, show)
        yield mcap, data


def _check_figures() -> None:
    """Check that there is matplotlib, without which exports work."""
    try:
        import matplotlib  # noqa: F401
    except ModuleNotFoundError as error:
        raise InputError(_MISSING_EXTRA) from error


def _draw(
    material: Material, facts: Facts, summary: Summary, page: Path | None, png: Path | None, svg: Path | None
) -> list[Path]:
    from viso.report import drawing
    from viso.report.figures import FIGURES
    from viso.report.page import make_page

    written: list[Path] = []
    inline: dict[Any, str | None] = {}
    drawn: list[Any] = []
    is_pdf = page is not None and page.suffix.lower() == _PDF
    with progress("drawing", len(FIGURES)) as show, drawing.style():
        for number, kind in enumerate(FIGURES, 1):
            figure = kind.draw(material, facts)
            if figure is not None:
                for folder, form in ((png, "png"), (svg, "svg")):
                    if folder is not None:
                        written.append(_write(folder / f"{kind.name}.{form}", drawing.saved(figure, form)))
            if is_pdf:
                drawn += [] if figure is None else [figure]
            elif page is not None:
                inline[kind] = None if figure is None else drawing.as_inline_svg(figure, kind.name, kind.title)
            show(number)
        if page is not None and is_pdf:
            lines = [
                f"{summary.level.badge.upper()}: {summary.sentence}",
                str(facts.judged_by),
                *(f"- {remark.text}" for remark in summary.remarks),
            ]
            written.append(_write(page, drawing.as_pdf(page.stem, lines, drawn)))
    if page is not None and not is_pdf:
        text = make_page(material, facts, summary, inline, installed_version())
        written.append(_write(page, text.encode("utf-8", "replace")))
    return written
