# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What each process of a sweep needs, loaded as this is imported: once, by the server that forks them."""

from viso.sweep import job as job
