# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The kinds of recorded streams, a file each; their table is in ``viso.streams.stream_kinds``."""
