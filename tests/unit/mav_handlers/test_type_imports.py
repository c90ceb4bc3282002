# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The endpoint's package knows the vehicle as a type only."""

import subprocess
import sys

IMPORT_ALL = """
import importlib, pkgutil, sys
import mav_handlers

for module in pkgutil.walk_packages(mav_handlers.__path__, "mav_handlers."):
    importlib.import_module(module.name)
print([name for name in sys.modules if name.partition(".")[0] == "viso"])
"""


def test_no_module_of_viso_is_imported_when_code_runs() -> None:
    outcome = subprocess.run([sys.executable, "-c", IMPORT_ALL], capture_output=True, text=True, check=True)
    assert outcome.stdout == "[]\n"
