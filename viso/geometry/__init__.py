# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations, rigid motions and trajectories in double precision, and the text files that hold trajectories."""
