# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstrations: an odometry on a flight, a survey flight, and vehicle, world and companion in one loop."""
