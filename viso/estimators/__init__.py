# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Delay, mounting, scale and clocks from two recordings of one motion: pure functions on numpy arrays."""
