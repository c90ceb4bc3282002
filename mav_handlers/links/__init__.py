# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Links: the only place of this package that does I/O."""

from mav_handlers.links.base import Link, LinkError, LinkStats, News, wait_readable
from mav_handlers.links.pair import PairLink, make_pair
from mav_handlers.links.table import LINKS, LinkFactory, is_open_to_network, open_link
from mav_handlers.links.tlog import TlogEntry, TlogError, TlogReader, TlogWriter, read_tlog

__all__ = [
    "LINKS",
    "Link",
    "LinkError",
    "LinkFactory",
    "LinkStats",
    "News",
    "PairLink",
    "TlogEntry",
    "TlogError",
    "TlogReader",
    "TlogWriter",
    "is_open_to_network",
    "make_pair",
    "open_link",
    "read_tlog",
    "wait_readable",
]
