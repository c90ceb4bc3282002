# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast the project runs on this machine, measured by pyperf: ``python -m tools.bench``."""
