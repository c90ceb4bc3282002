# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Many replays of recorded streams, with parameters, faults, seeds and firmware changed, and what came of each."""
