# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the filter's arithmetic runs on."""

from collections.abc import Callable
from typing import Final, NamedTuple

from ekf_stub.filter import quaternions as quaternion
from ekf_stub.filter.error_state import ErrorState
from ekf_stub.filter.inertial import Array
from ekf_stub.filter.inertial_pass import InertialPass


class Kernel(NamedTuple):
    """What makes the two parts of the filter that compute.

    ``make_state`` makes its state from an attitude and the variances of velocity and position, ``make_pass`` what
    inertial data go through.
    """

    make_state: Callable[[quaternion.quaternion, Array], ErrorState]
    make_pass: Callable[[], InertialPass]


PLAIN: Final = Kernel(ErrorState, InertialPass)
"""Python with numpy: the definition and the default. `ekf_stub.compiled.compiled_pass` has a faster one."""
