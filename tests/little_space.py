# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""A disk on which there is little space."""

import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def space_for(size: int) -> Iterator[None]:
    """Let no file grow beyond a size in bytes; Python ignores the signal that goes with it.

    Nor does Python look whether it could write the whole of a module's byte code, which then breaks later imports.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    wrote_none = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        sys.dont_write_bytecode = wrote_none
