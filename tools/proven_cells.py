# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Return which differences of a release its recordings prove: ``python -m tools.proven_cells FOLDER``.

Each strategy in which a profile differs from another one is put back to the other's, one at a time. Where a recording
then comes out otherwise, it proves that strategy; docs/firmware.md calls what none proves "read".
"""

import argparse
from collections.abc import Iterator
from dataclasses import fields, replace
from pathlib import Path

from rich.table import Table

from viso.compare.recordings import compare_recording, recordings_in
from viso.firmware.releases import JULY_2025, PROFILES, Firmware
from viso.replay.ekf.run import NothingToCompare
from viso.terminal.console import err, out

PARTS = ("visual_odom", "endpoint", "ekf")


def cells(one: Firmware, other: Firmware) -> Iterator[tuple[str, Firmware]]:
    """Yield the strategies in which a profile differs from another, each with the profile that has the other's."""
    for part in PARTS:
        own, others = getattr(one, part), getattr(other, part)
        for field in fields(own):
            if getattr(own, field.name) != getattr(others, field.name):
                changed = replace(own, **{field.name: getattr(others, field.name)})
                yield f"{part}.{field.name}", replace(one, **{part: changed})


def main() -> None:
    """Print a row a strategy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="recordings of one release, or folders of them")
    parser.add_argument("--against", choices=PROFILES, default=JULY_2025.name, help="the profile to differ from")
    options = parser.parse_args()
    proven: dict[str, list[str]] = {}
    for path, _ in recordings_in(options.recordings):
        err.print(f"{path} ...")
        try:
            before = compare_recording(path)
        except NothingToCompare as error:
            err.print(f"note: passed over: {error}")
            continue
        for name, variant in cells(PROFILES[before.firmware], PROFILES[options.against]):
            differ = len(compare_recording(path, variant).differences) > len(before.differences)
            proven.setdefault(name, []).extend([path.name] if differ else [])
    table = Table("strategy", "proven by")
    for name, names in proven.items():
        table.add_row(name, ", ".join(names) or "nothing here")
    out.print(table)


if __name__ == "__main__":
    main()
