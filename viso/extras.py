# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The distribution's name and version, and how to install a library that an extra brings."""

from typing import Final

DISTRIBUTION: Final = "ardupilot-viso"
"""By which the package index knows this project; the name viso there is a stranger's."""


def installed_version() -> str:
    """Return the version that is installed; "unknown" for a checkout that is not."""
    from importlib.metadata import PackageNotFoundError, version  # takes longer to import than most who ask for a hint

    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "unknown"


def pip_install(extra: str) -> str:
    """Return the command that installs this project with an extra, or with several between commas."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"
