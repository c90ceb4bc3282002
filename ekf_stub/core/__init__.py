# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Cores: frames in, mode, report; and the choice of the primary core."""
