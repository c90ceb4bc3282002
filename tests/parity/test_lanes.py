# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Each core says what that of the firmware said, also one whose sensors fail, and the same one is primary."""

from pathlib import Path
from typing import Final

import numpy as np
import pytest

from tests.places import DATA
from viso.compare.logs import estimate_differences
from viso.firmware.releases import JULY_2025
from viso.replay.ekf.run import EkfReplay, EkfRun

LOGS: Final = sorted((DATA / "lanes").glob("*.BIN.xz"))
NEAR_M: Final = 1e-3
NEAR_MS: Final = 1e-3
NEAR_DEG: Final = 0.03

pytestmark = pytest.mark.slow


def worst(run: EkfReplay, *labels: str) -> float:
    """Return how far one of some estimates ever is from the recorded one, angles the shorter way round."""
    apart = np.array([run.ours[label] - run.recorded[label] for label in labels])
    return float(np.abs((apart + 180) % 360 - 180 if "Yaw" in labels else apart).max())


@pytest.mark.parametrize("path", [pytest.param(path, id=path.name.partition(".")[0]) for path in LOGS])
def test_each_core_is_the_firmwares(path: Path) -> None:
    run = EkfRun(path, firmware=JULY_2025)
    run.run()
    for core in run.imus:
        replay = run.comparison(core)
        assert replay is not None
        assert list(estimate_differences(replay, core)) == []
        assert worst(replay, "PN", "PE", "PD") < NEAR_M
        assert worst(replay, "VN", "VE", "VD") < NEAR_MS
        assert worst(replay, "Roll", "Pitch", "Yaw") < NEAR_DEG
        assert np.array_equal(replay.ours["SS"], replay.recorded["SS"])
    assert [text for _, text in run.our_lanes] == [text for _, text in run.recorded_lanes]
