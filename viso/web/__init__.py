# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The live view: a page in the browser that shows what the autopilot does with a stream."""
