# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""How many threads the libraries take that a strategy calls. Needs the extra vio."""

import cv2
import threadpoolctl


def limit_threads(count: int) -> None:
    """Let the libraries for pictures and for linear algebra use so many threads, in all of this process.

    The matrices of a filter are small: two threads take longer for them than one, and eight times as long where
    another program keeps the second core busy.
    """
    cv2.setNumThreads(count)
    threadpoolctl.threadpool_limits(limits=count, user_api="blas")
