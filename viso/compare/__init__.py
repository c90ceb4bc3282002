# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What was recorded against what viso computes: vectors, captures, logs, filters and replays, field by field."""
