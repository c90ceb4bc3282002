# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many threads libraries take."""

from collections.abc import Iterator

import cv2
import numpy as np
import pytest
import threadpoolctl

from viso.companion.strategies.tracking import _limit_threads


@pytest.fixture(autouse=True)
def _as_it_was() -> Iterator[None]:
    before = cv2.getNumThreads()
    with threadpoolctl.threadpool_limits():
        yield
    cv2.setNumThreads(before)


@pytest.mark.parametrize("count", [1, 2])
def test_both_libraries_take_as_many_as_they_may(count: int) -> None:
    np.linalg.inv(np.eye(3))
    _limit_threads(count)
    pools = [pool for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]
    assert pools
    assert {pool["num_threads"] for pool in pools} == {count}
    assert cv2.getNumThreads() == count
