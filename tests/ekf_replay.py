# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The first core of the filter over a log."""

import math
from pathlib import Path

from viso.errors import InputError
from viso.firmware.releases import Firmware
from viso.replay.ekf.run import EkfReplay, EkfRun


def replay_ekf(path: Path, *, until_s: float = math.inf, firmware: Firmware | None = None) -> EkfReplay:
    """Run the first core of the filter over a log, up to a time since boot.

    Raises InputError if the log cannot be read, or has no replay records, or no estimates.
    """
    run = EkfRun(path, until_s=until_s, core=0, firmware=firmware)
    run.run()
    replay = run.comparison()
    if replay is None:
        raise InputError(f"{path}: no XKF records to compare with")
    return replay
