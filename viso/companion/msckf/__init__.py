# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""An error-state filter with a window of past poses (multi-state constraint Kalman filter)."""
