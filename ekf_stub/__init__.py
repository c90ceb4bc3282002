# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Stand-ins for the AHRS and EKF that receive external navigation data."""

from ekf_stub.ahrs.ahrs_ekf3 import Ekf3Ahrs
from ekf_stub.ahrs.ahrs_recorded import RecordedAhrs, RecordedStates
from ekf_stub.ahrs.ahrs_settable import SettableAhrs

__all__ = ["Ekf3Ahrs", "RecordedAhrs", "RecordedStates", "SettableAhrs"]
