# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Sources of the filter's inertial data, height and magnetic field: a row of ``inertial_sources`` each."""
