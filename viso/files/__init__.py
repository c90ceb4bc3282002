# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files, pages in HTML, outputs, secrets on disk; no knowledge of vehicles."""
