# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso ekf`: the filter run over the replay records of a log, and judged."""
