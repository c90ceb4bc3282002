# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Visual-inertial odometry: data types, errors, health, configuration, and the runner of strategies."""
