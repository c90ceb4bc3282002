# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The part that is ArduCopter: modes, arming, landing, home, EKF check."""
