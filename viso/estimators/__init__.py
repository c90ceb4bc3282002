# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What two recordings of one motion say about delay, mounting, scale and clocks: pure functions on numpy arrays."""
