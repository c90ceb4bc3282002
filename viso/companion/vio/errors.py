# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The errors of visual-inertial odometry; the outcome of a frame is not an error but a result."""


class VioError(Exception):
    """The base of all errors of visual-inertial odometry."""


class VioFatalError(VioError):
    """A strategy cannot go on before a reset, or its caller misused it.

    A strategy may raise it while it works on a frame, whose result is then ``Lost``.
    """


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
