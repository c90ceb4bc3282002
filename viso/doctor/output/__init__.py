# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A diagnosis as text, tables, JSON, SARIF and JUnit."""
