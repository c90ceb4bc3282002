# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the baseline strategy keeps in memory, measured in a process of its own."""

import json
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

WARM_UP_FRAMES = 30
PROGRAM = """
import json, sys
from pathlib import Path
from tests.fault.vio_flight import FlownStrategy
from viso.companion.world.ground import generate_texture

def resident_mb():
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096e-6

width, height, enlargement, warm_up, frames = map(int, sys.argv[1:])
flown, resident = FlownStrategy(generate_texture(), width, height, enlargement), []
for count in (warm_up, frames):
    for _ in range(count):
        flown.run()
    resident.append(resident_mb())
print(json.dumps(resident))
"""


@pytest.mark.parametrize(
    ("width", "height", "enlargement", "frames", "limit_mb"),
    [pytest.param(640, 480, 1, 150, 250, id="small"), pytest.param(5472, 3648, 4, 40, 600, id="full size")],
)
def test_memory_is_small_and_does_not_grow(
    width: int, height: int, enlargement: int, frames: int, limit_mb: float
) -> None:
    arguments = map(str, (width, height, enlargement, WARM_UP_FRAMES, frames))
    done = subprocess.run([sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, check=True)
    early_mb, late_mb = json.loads(done.stdout)
    assert late_mb <= limit_mb
    assert late_mb - early_mb < 15
