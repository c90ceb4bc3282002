# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where tests find what they read."""

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
DATA: Final = ROOT / "tests" / "data"
PARITY: Final = DATA / "parity"  # what releases of the firmware did: a folder for each
RECORDED: Final = PARITY / "2025-07"
SHARED: Final = ROOT.parent / "shared" / "data"  # recordings too large for the project; tests go without them
