# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a strategy and its factory raise."""

from viso.companion.vio.types import VioOutput


class VioError(Exception):
    """The base of all errors of visual-inertial odometry."""


class VioInitializingError(VioError):
    """There is no state yet, and so no output: nothing may go to the autopilot."""


class VioDegradedError(VioError):
    """A frame's output is to be used with less weight.

    Attributes:
        output: the output, its covariance already inflated.
        reason: why, as in the health.
    """

    def __init__(self, reason: str, output: VioOutput) -> None:
        super().__init__(reason)
        self.reason = reason
        self.output = output


class VioFatalError(VioError):
    """There is no output and there will be none before a warm start; or the strategy was misused."""

    output: None = None


class StrategyNotAvailableError(VioError):
    """The factory cannot build a strategy.

    Attributes:
        name: the strategy's.
        reason: why, in one line.
    """

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"strategy {name} is not available: {reason}")
        self.name = name
        self.reason = reason
