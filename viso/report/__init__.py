# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a flight's log tells of external navigation: figures, a page to read, and trajectories for other tools."""
