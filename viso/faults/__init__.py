# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""`viso faults`: files, proxy, tables. The injector is viso/companion/faults."""
