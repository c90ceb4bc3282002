# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the real clients are."""

from pathlib import Path

import pytest

from tools.interop_environment import ensure


@pytest.fixture(scope="session")
def clients() -> Path:
    """Return the environment with the clients; without it their tests fail, they are not skipped."""
    return ensure()
