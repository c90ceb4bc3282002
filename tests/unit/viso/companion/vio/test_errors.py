# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What errors say."""

import pytest

from viso.companion.vio.errors import StrategyNotAvailableError, VioError, VioFatalError


@pytest.mark.parametrize("kind", [VioFatalError, StrategyNotAvailableError])
def test_every_error_is_a_vio_error(kind: type[Exception]) -> None:
    assert issubclass(kind, VioError)


def test_missing_strategy_is_named_with_the_reason() -> None:
    error = StrategyNotAvailableError("okvis2", "no program")
    assert (error.name, error.reason) == ("okvis2", "no program")
    assert str(error) == "strategy okvis2 is not available: no program"
