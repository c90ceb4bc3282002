# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A synthetic world: ground, flight, IMU and camera. The same seed gives the same world."""
