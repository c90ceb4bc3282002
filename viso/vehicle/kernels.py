# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter's arithmetic runs on: plain Python with numpy, or functions compiled by numba.

Plain is the definition. What numba compiles is used where numba is installed; the environment variable VISO_KERNEL says
otherwise, for every command and worker.
"""

import logging
import os
from collections.abc import Callable, Mapping
from functools import cache
from importlib.util import find_spec
from typing import Final

from ekf_stub.filter.kernel import PLAIN as PLAIN_KERNEL
from ekf_stub.filter.kernel import Kernel
from viso.errors import InputError
from viso.extras import pip_install

KERNEL_VARIABLE: Final = "VISO_KERNEL"
PLAIN: Final = "plain"
NUMBA: Final = "numba"

_log = logging.getLogger(__name__)


def _plain() -> Kernel:
    return PLAIN_KERNEL


def _tell_compiled(number: int, count: int) -> None:
    _log.warning("compiling the filter, once on this machine: %d of %d", number, count)


@cache
def _warm_up_once() -> None:
    from ekf_stub.compiled.warm_up import warm_up

    warm_up(_tell_compiled)


def _compiled() -> Kernel:
    try:
        from ekf_stub.compiled.compiled_pass import COMPILED
    except (ImportError, RuntimeError) as error:  # the latter where numba finds no folder to keep anything in
        _log.warning("%s: %s; going on with %s; %s", NUMBA, error, PLAIN, pip_install("numba"))
        return PLAIN_KERNEL
    _warm_up_once()
    return COMPILED


KERNELS: Final[Mapping[str, Callable[[], Kernel]]] = {PLAIN: _plain, NUMBA: _compiled}
"""What finds a kernel, by its name; one row each."""


def kernel_of(name: str) -> Kernel:
    """Return a kernel by its name; the plain one, and a warning, when an extra is missing. Raises InputError."""
    if name not in KERNELS:
        raise InputError(f"{KERNEL_VARIABLE}={name}: no such kernel; there are {', '.join(KERNELS)}")
    return KERNELS[name]()


def chosen_kernel() -> str:
    """Return the name of the kernel that the environment asks for, or else of the fastest that is installed."""
    return os.environ.get(KERNEL_VARIABLE) or (NUMBA if find_spec("numba") else PLAIN)
