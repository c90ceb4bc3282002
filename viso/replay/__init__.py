# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso replay`: a recorded stream through the vehicle, and the verdicts as firmware vectors."""
