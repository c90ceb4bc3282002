# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparer: recordings against viso and replays against replays, field by field, with one table of tolerances."""
