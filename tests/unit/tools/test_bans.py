# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""ruff and import-linter find what is banned where it is banned, and nothing else."""

import copy
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import grimp
import pytest
from importlinter.api import read_configuration
from importlinter.contracts.forbidden import ForbiddenContract

from tests.places import ROOT

HEADER = "# SPDX-FileCopyrightText: 2026 The viso authors\n# SPDX-License-Identifier: GPL-3.0-or-later\n"
CODES = ("TID251", "PTH123", "T201", "CPY001")

BANNED_NAMES = [
    ("ap_visualodom/a.py", "from datetime import datetime\ndatetime.now()", "datetime.datetime.now"),
    ("ekf_stub/a.py", "import datetime as dt\ndt.datetime.utcnow()", "datetime.datetime.utcnow"),
    ("mav_handlers/wire/a.py", "import datetime\ndatetime.date.today()", "datetime.date.today"),
    ("viso/a.py", "import numpy as np\nnp.datetime64.now()", "numpy.datetime64.now"),
    ("ap_core/a.py", "open('x')", "PTH123"),
    ("mav_handlers/a.py", "from importlib import resources", "importlib.resources"),
    ("ap_core/a.py", "import numpy as np\nnp.load('x')", "numpy.load"),
    ("ap_core/a.py", "import numpy as np\nnp.sin(0)", "numpy.sin"),
    ("ap_core/a.py", "import numpy\nf = numpy.arctan2", "numpy.arctan2"),
    ("ap_visualodom/a.py", "from numpy import cos as c", "numpy.cos"),
    ("ap_visualodom/a.py", "import math\nmath.atan2(0, 1)", "math.atan2"),
    ("viso/a.py", "print('x')", "T201"),
    ("tests/unit/ap_core/a.py", "import time\ntime.sleep(1)", "time.sleep"),
]

ALLOWED_NAMES = [
    ("mav_handlers/links/a.py", "import datetime\nopen('x')\ndatetime.date.today()"),
    ("viso/cli.py", "print('x')"),
    ("viso/commands/a.py", "print('x')"),
    ("viso/a.py", "open('x')"),
    ("tests/interop/a.py", "import time\ntime.sleep(1)\nprint('x')"),
    ("tools/a.py", "print(open('x'))"),
    ("ap_core/fmath.py", "import math\nmath.sin(0)"),
    ("ap_core/a.py", "import numpy as np\nimport math\nnp.sqrt(2)\nmath.isnan(1)"),
    ("ap_core/a.py", "from datetime import datetime, timedelta\ndatetime(2026, 1, 1)"),
    ("ekf_stub/a.py", "import numpy as np\nnp.sin(0)"),
]

BANNED_IMPORTS = [
    *[(package, "time") for package in ("ap_core", "ap_visualodom", "ekf_stub", "viso", "viso.companion")],
    *[("mav_handlers", module) for module in ("socket", "selectors", "threading", "io", "pathlib", "tempfile")],
    ("mav_handlers.wire", "urllib"),
    ("ekf_stub", "os"),
    ("ap_core", "subprocess"),
    *[(package, "pymavlink") for package in ("viso.companion", "mav_handlers.links")],
]

ALLOWED_IMPORTS = [
    *[("mav_handlers.links", module) for module in ("socket", "time", "os", "pathlib")],
    ("viso", "pathlib"),
    ("ap_core", "math"),
]


def _ruff(name: str, source: str) -> str:
    command = [
        str(Path(sys.executable).parent / "ruff"),
        "check",
        "--output-format=concise",
        "--stdin-filename",
        name,
        "-",
    ]
    done = subprocess.run(command, input=source, cwd=ROOT, capture_output=True, text=True, check=False)
    # What else there is to say about a snippet (an unused import) is of no matter here.
    return "\n".join(line for line in done.stdout.splitlines() if any(code in line for code in CODES))


@cache
def _graph() -> tuple[grimp.ImportGraph, dict[str, Any]]:
    options = read_configuration(str(ROOT / "pyproject.toml"))
    packages = options["session_options"]["root_packages"]
    return grimp.build_graph(*packages, include_external_packages=True, cache_dir=None), options


def _breaks_a_contract(package: str, module: str) -> bool:
    """Return whether an import of `module` by a new module of `package` breaks a contract with forbidden modules."""
    graph, options = _graph()
    for contract in options["contracts_options"]:
        if contract["type"] == "forbidden":
            tried = copy.deepcopy(graph)
            tried.add_import(importer=f"{package}.a", imported=module)
            found = ForbiddenContract(contract["name"], options["session_options"], contract)
            if not found.check(tried, verbose=False).kept:
                return True
    return False


@pytest.mark.parametrize(("name", "source", "banned"), BANNED_NAMES)
def test_banned_name_is_found(name: str, source: str, banned: str) -> None:
    assert banned in _ruff(name, HEADER + source)


@pytest.mark.parametrize(("name", "source"), ALLOWED_NAMES)
def test_allowed_name_passes(name: str, source: str) -> None:
    assert _ruff(name, HEADER + source) == ""


@pytest.mark.parametrize(("package", "module"), BANNED_IMPORTS)
def test_banned_import_is_found(package: str, module: str) -> None:
    assert _breaks_a_contract(package, module)


@pytest.mark.parametrize(("package", "module"), ALLOWED_IMPORTS)
def test_allowed_import_passes(package: str, module: str) -> None:
    assert not _breaks_a_contract(package, module)


@pytest.mark.parametrize("source", [HEADER, f"#!/usr/bin/env python3\n{HEADER}", f"{HEADER}x = 1\n"])
def test_the_two_spdx_lines_come_first(source: str) -> None:
    assert _ruff("viso/a.py", source) == ""


@pytest.mark.parametrize("source", ["", "x = 1\n", f"x = 1\n{HEADER}", f"\n{HEADER}", HEADER.replace("GPL", "LGPL")])
def test_missing_or_misplaced_spdx_lines_are_found(source: str) -> None:
    assert "CPY001" in _ruff("viso/a.py", source)
