# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The place where everything meets: vehicle, scheduler, scenarios and commands."""
