# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""From a strategy's output to MAVLink ODOMETRY, and from the flight controller's messages to a strategy's input."""
