# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A multicopter that flies: a point mass with a thrust, where it really is, and what its sensors feel."""
