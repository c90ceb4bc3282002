# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso replay`, `viso ekf` and `viso vectors`: a stream, a log or calls of the firmware, played again."""
