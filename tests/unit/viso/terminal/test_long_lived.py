# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The garbage collector is kept from what stays, and is afterwards as it was before."""

import gc
import subprocess
import sys

import pytest

from viso.terminal.long_lived import uncollected

PROGRAM = """
import gc
from viso.terminal.long_lived import long_lived, uncollected
with uncollected():
    kept = [[number] for number in range(100_000)]
    assert gc.get_count()[0] > 100_000
assert gc.isenabled() and not gc.get_freeze_count()
assert len(gc.get_objects(generation=0)) < 1000 and len(gc.get_objects(generation=1)) < 1000
assert len(gc.get_objects(generation=2)) > 100_000
with long_lived():
    assert gc.get_freeze_count() > 100_000
assert not gc.get_freeze_count()
"""


def test_what_is_made_meanwhile_counts_as_old() -> None:
    subprocess.run([sys.executable, "-c", PROGRAM], check=True, timeout=60)


@pytest.mark.parametrize("on", [True, False])
def test_the_collector_is_off_meanwhile_and_then_as_before(on: bool) -> None:
    frozen = gc.get_freeze_count()
    if not on:
        gc.disable()
    try:
        with uncollected():
            assert not gc.isenabled()
        assert gc.isenabled() == on
        assert gc.get_freeze_count() == frozen
    finally:
        gc.enable()
