# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter's arithmetic runs on: plain Python with numpy, or functions compiled by numba.

Plain is the definition and the default. The environment variable VISO_KERNEL chooses for every command and worker.
"""

import logging
import os
from collections.abc import Callable, Mapping
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


def _compiled() -> Kernel:
    try:
        from ekf_stub.compiled.compiled_pass import COMPILED
    except ModuleNotFoundError as error:
        _log.warning("%s: %s; going on with %s; %s", NUMBA, error, PLAIN, pip_install("numba"))
        return PLAIN_KERNEL
    return COMPILED


KERNELS: Final[Mapping[str, Callable[[], Kernel]]] = {PLAIN: _plain, NUMBA: _compiled}
"""What finds a kernel, by its name; one row each."""


def kernel_of(name: str) -> Kernel:
    """Return a kernel by its name; the plain one, and a warning, when an extra is missing. Raises InputError."""
    if name not in KERNELS:
        raise InputError(f"{KERNEL_VARIABLE}={name}: no such kernel; there are {', '.join(KERNELS)}")
    return KERNELS[name]()


def chosen_kernel() -> str:
    """Return the name of the kernel that the environment asks for."""
    return os.environ.get(KERNEL_VARIABLE) or PLAIN
