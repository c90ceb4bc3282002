# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Fuzz a target, guided by coverage; docs/robustness.md says how to install atheris and to start this.

``fuzz.py endpoint|files [libFuzzer options] [corpus folders]``
"""

import logging
import sys
import tempfile
import warnings
from pathlib import Path

import atheris

# What is read in here is instrumented; numpy and pymavlink would only slow it down.
PACKAGES = ["ap_core", "ap_visualodom", "ekf_stub", "mav_handlers", "viso"]
TARGETS = ("endpoint", "files")


def main(arguments: list[str]) -> None:
    """Run a target until libFuzzer has had enough."""
    if len(arguments) < 2 or arguments[1] not in TARGETS:
        sys.exit(f"usage: {arguments[0]} {'|'.join(TARGETS)} [options] [corpus folders]")
    program, name, *options = arguments
    with atheris.instrument_imports(include=PACKAGES):
        if name == "endpoint":
            from tests.fuzz import endpoint_target as target
        else:
            from tests.fuzz import file_target as target  # type: ignore[no-redef]  # the other one of the two
    warnings.simplefilter("error")
    logging.disable()
    with tempfile.TemporaryDirectory(prefix="viso-fuzz-") as folder:
        atheris.Setup([program, *options], lambda data: target.run(data, Path(folder)))
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv)
