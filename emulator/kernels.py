# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter's arithmetic runs on: plain Python with numpy, or functions compiled by numba.

Plain is the definition and the default. The environment variable VISO_KERNEL chooses for every command and worker.
"""

import logging
import os
from collections.abc import Callable, Mapping
from typing import Final

from ekf_stub.ekf3_core import MakeState
from ekf_stub.error_state import ErrorState
from emulator.errors import InputError

KERNEL_VARIABLE: Final = "VISO_KERNEL"
PLAIN: Final = "plain"
NUMBA: Final = "numba"

_log = logging.getLogger(__name__)


def _plain() -> MakeState:
    return ErrorState


def _compiled() -> MakeState:
    try:
        from ekf_stub.compiled_state import CompiledErrorState
    except ModuleNotFoundError as error:
        _log.warning("%s: %s; going on with %s; pip install 'viso[numba]'", NUMBA, error, PLAIN)
        return ErrorState
    return CompiledErrorState


KERNELS: Final[Mapping[str, Callable[[], MakeState]]] = {PLAIN: _plain, NUMBA: _compiled}
"""What makes the filter of a kernel, by the kernel's name; one row each."""


def make_state_of(kernel: str) -> MakeState:
    """Return what makes the filter of a kernel; of the plain one, and a warning, when an extra is missing.

    Raises:
        InputError: there is no such kernel.
    """
    if kernel not in KERNELS:
        raise InputError(f"{KERNEL_VARIABLE}={kernel}: no such kernel; there are {', '.join(KERNELS)}")
    return KERNELS[kernel]()


def chosen_kernel() -> str:
    """Return the name of the kernel that the environment asks for."""
    return os.environ.get(KERNEL_VARIABLE) or PLAIN
