# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""HIL_SENSOR and HIL_STATE_QUATERNION."""
