# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Recorded engines: the trajectory that any odometry wrote, played as external navigation."""
