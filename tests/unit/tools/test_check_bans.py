# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The ban checker finds what is banned where it is banned, and nothing else."""

import pytest

from tools.check_bans import BANS, Ban, findings_in

BANNED = [
    ("ap_core/a.py", "import time", "time"),
    ("ap_core/a.py", "from time import monotonic", "time"),
    ("ap_visualodom/a.py", "from datetime import datetime\ndatetime.now()", "datetime.datetime.now"),
    ("ekf_stub/a.py", "import datetime as dt\ndt.datetime.utcnow()", "datetime.datetime.utcnow"),
    ("viso/companion/a.py", "import time", "time"),
    ("viso/a.py", "import time as t", "time"),
    ("mav_handlers/a.py", "import socket", "socket"),
    ("mav_handlers/a.py", "import selectors", "selectors"),
    ("mav_handlers/wire/a.py", "from urllib.request import urlopen", "urllib"),
    ("ekf_stub/a.py", "import os.path", "os"),
    ("ap_core/a.py", "import subprocess", "subprocess"),
    ("ap_core/a.py", "open('x')", "open"),
    ("ap_core/a.py", "from pathlib import Path", "pathlib.Path"),
    ("ap_core/a.py", "import pathlib\nx = pathlib.Path('x')", "pathlib.Path"),
    ("ap_core/a.py", "def f(p: object) -> None:\n    p.read_text()", ".read_text"),
    ("ap_core/a.py", "import io\nio.open('x')", "io.open"),
    ("ap_core/a.py", "import numpy as np\nnp.load('x')", "numpy.load"),
    ("ap_core/a.py", "import numpy as np\nnp.sin(0)", "numpy.sin"),
    ("ap_core/a.py", "import numpy\nf = numpy.arctan2", "numpy.arctan2"),
    ("ap_visualodom/a.py", "from numpy import cos as c", "numpy.cos"),
    ("ap_visualodom/a.py", "import math\nmath.atan2(0, 1)", "math.atan2"),
    ("viso/companion/a.py", "from pymavlink import mavutil", "pymavlink"),
    ("mav_handlers/links/a.py", "import pymavlink.dialects.v20.common", "pymavlink"),
    ("viso/a.py", "print('x')", "print"),
    ("tests/unit/ap_core/a.py", "import time\ntime.sleep(1)", "time.sleep"),
]

ALLOWED = [
    ("mav_handlers/links/a.py", "import socket, time, os\nopen('x')"),
    ("viso/running/real_time.py", "import time\ntime.sleep(1)"),
    ("viso/cli.py", "print('x')"),
    ("viso/commands/a.py", "print('x')"),
    ("viso/a.py", "from pathlib import Path\nopen('x')"),
    ("mav_handlers/wire/codec.py", "from pymavlink.dialects.v20 import ardupilotmega"),
    ("tests/interop/a.py", "from pymavlink import mavutil\nimport time\ntime.sleep(1)"),
    ("tools/a.py", "import os, time\nprint(open('x'))"),
    ("ap_core/fmath.py", "import ctypes, math\nmath.sin(0)"),
    ("ap_core/a.py", "import numpy as np\nimport math\nnp.sqrt(2)\nmath.isnan(1)"),
    ("ap_core/a.py", "import io\nio.BytesIO()\nfrom pathlib import PurePosixPath"),
    ("ap_core/a.py", "from datetime import datetime, timedelta\ndatetime(2026, 1, 1)"),
    ("ap_core/a.py", "from . import time\ntime.now()"),
    ("ap_core/a.py", "def f(clock: object) -> None:\n    clock.time.sin()"),
    ("ap_core/a.py", "# import time\nx = 'open(), time.time() and print()'"),
    ("ekf_stub/a.py", "import numpy as np\nnp.sin(0)"),
    ("mav_handlers/a.py", "class Link:\n    open: bool = True"),
]


@pytest.mark.parametrize(("name", "source", "banned"), BANNED)
def test_banned_use_is_found(name: str, source: str, banned: str) -> None:
    assert any(f": {banned}: " in line for line in findings_in(name, source))


@pytest.mark.parametrize(("name", "source"), ALLOWED)
def test_allowed_use_passes(name: str, source: str) -> None:
    assert findings_in(name, source) == []


def test_finding_names_file_line_and_what_to_do_instead() -> None:
    (line,) = findings_in("ap_core/a.py", "x = 1\nimport time\n")
    assert line == "ap_core/a.py:2: time: take the time as an argument"


def test_one_use_is_reported_once() -> None:
    assert len(findings_in("ap_core/a.py", "import os\n")) == 1
    assert len(findings_in("ap_core/a.py", "from numpy import sin\n")) == 1


def test_a_ban_does_not_reach_modules_with_a_longer_name() -> None:
    ban = Ban(frozenset({"time"}), ("ap_core/",), (), "no")
    assert findings_in("ap_core/a.py", "import timeit", (ban,)) == []


def test_every_ban_holds_somewhere() -> None:
    assert all(ban.names and ban.where for ban in BANS)
