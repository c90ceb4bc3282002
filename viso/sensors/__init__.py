# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the filter's inertial data, height and magnetic field come from: a row of ``inertial_sources`` each."""
