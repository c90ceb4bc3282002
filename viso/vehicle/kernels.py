# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter's arithmetic runs on: plain Python with numpy, or functions compiled by numba.

Plain is the definition. What numba compiles is used where numba is installed; the environment variable VISO_KERNEL says
otherwise, for every command and worker.
"""

import gc
import logging
import os
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Final

from ekf_stub.filter.inertial_pass import PLAIN as PLAIN_KERNEL
from ekf_stub.filter.inertial_pass import Kernel
from viso.errors import InputError
from viso.extras import pip_install

KERNEL_VARIABLE: Final = "VISO_KERNEL"
PLAIN: Final = "plain"
NUMBA: Final = "numba"

_log = logging.getLogger(__name__)


def _tell_compiled(number: int, count: int) -> None:
    _log.warning("compiling the filter, once on this machine: %d of %d", number, count)


def _load(on_compiled: Callable[[int, int], None]) -> Kernel:
    try:
        from ekf_stub.compiled.compiled_pass import COMPILED
    except (ImportError, RuntimeError) as error:  # the latter where numba finds no folder to keep anything in
        _log.warning("%s: %s; going on with %s; %s", NUMBA, error, PLAIN, pip_install("numba"))
        return PLAIN_KERNEL
    from ekf_stub.compiled.warm_up import warm_up

    warm_up(on_compiled)
    return COMPILED


class _Ended(Exception):
    """Nobody needs any more what is being compiled."""


class _Loader(threading.Thread):
    """Loads the compiled kernel beside what else runs.

    Attributes:
        is_known: set when the kernel is there, or has to be compiled first.
        kernel: it, None until then.
        is_wanted: whether to go on.
    """

    def __init__(self) -> None:
        super().__init__(name="kernel")
        self.is_known = threading.Event()
        self.kernel: Kernel | None = None
        self.is_wanted = True

    def run(self) -> None:
        """Load it."""
        try:
            self.kernel = _load(self._go_on)
        except _Ended:
            pass
        finally:
            if gc.get_freeze_count():
                gc.freeze()  # with all else that stays
            self.is_known.set()

    def _go_on(self, number: int, count: int) -> None:
        self.is_known.set()
        _tell_compiled(number, count)
        if not self.is_wanted:
            raise _Ended


_loader: _Loader | None = None


def _compiled() -> Kernel:
    if _loader is None:
        return _load(_tell_compiled)
    _loader.is_known.wait()
    if _loader.kernel is None:
        _log.warning("until it is compiled, or until a restart, the filter runs %s", PLAIN)
    return _loader.kernel or PLAIN_KERNEL


KERNELS: Final[Mapping[str, Callable[[], Kernel]]] = {PLAIN: lambda: PLAIN_KERNEL, NUMBA: _compiled}
"""What finds a kernel, by its name; one row each."""


def finder_of(name: str) -> Callable[[], Kernel]:
    """Return what finds a kernel by its name, loading it if need be. Raises InputError."""
    if name not in KERNELS:
        raise InputError(f"{KERNEL_VARIABLE}={name}: no such kernel; there are {', '.join(KERNELS)}")
    return KERNELS[name]


def kernel_of(name: str) -> Kernel:
    """Return a kernel by its name; the plain one, and a warning, when an extra is missing. Raises InputError."""
    return finder_of(name)()


@contextmanager
def loading_beside() -> Iterator[None]:
    """Load the chosen kernel while a vehicle already runs, whose filter begins seconds after boot.

    If it has to be compiled first, which takes long, a filter that begins meanwhile runs on the plain one.
    """
    global _loader
    if chosen_kernel() != NUMBA:
        yield
        return
    _loader = _Loader()
    _loader.start()
    try:
        yield
    finally:
        _loader.is_wanted = False
        _loader.join()
        _loader = None


def chosen_kernel() -> str:
    """Return the name of the kernel that the environment asks for, or else of the fastest that is installed."""
    return os.environ.get(KERNEL_VARIABLE) or (NUMBA if find_spec("numba") else PLAIN)
