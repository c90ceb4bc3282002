# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand-ins for the AHRS and EKF that receive external navigation data."""
