# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What every source of inertial data is told, and what most of them have in common."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ekf_stub.filter.inertial import Array
from viso.sensors.errors import NO_ERRORS, ErrorModel, SensorErrors

_NOTHING_AHEAD: Final[Array] = np.zeros((0, 8))


@dataclass(frozen=True, slots=True)
class ImuOptions:
    """What a source of inertial data may use.

    Attributes:
        heading_rad: where the vehicle points at first, if the source itself does not know.
        has_compass: says whether there is a compass, and in use.
        errors: what is wrong with the sensors.
        seed: of the random part of the errors.
    """

    heading_rad: float = 0.0
    has_compass: Callable[[], bool] = lambda: False
    errors: SensorErrors = NO_ERRORS
    seed: int = 0


class UnmovedSource:
    """What a source does that does not heed arming; ``SensorSource`` tells what it is to do."""

    has_recorded_heights = False

    def __init__(self, options: ImuOptions) -> None:
        self._options = options
        self._model = ErrorModel(options.errors, options.seed)

    def ahead(self, times_us: range) -> Array:
        """Say nothing beforehand."""
        return _NOTHING_AHEAD

    def pass_over(self, times_us: range) -> None:
        """Do nothing: nothing was said beforehand."""

    def set_armed(self, armed: bool) -> None:
        """Go on as before, armed or not."""

    def is_at_rest(self, until_us: int) -> bool:
        """Stand still as long as nothing comes that says otherwise."""
        return True
