# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Shared floor without I/O: float32 maths, C integers, clock, parameters and DataFlash records."""
