# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The benches: one row each."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Final, NamedTuple

from tools.bench import logs, messages, startup, vehicles, vio
from viso.vehicle.kernels import NUMBA, PLAIN


class Bench(NamedTuple):
    """One row of the table of benches.

    Attributes:
        unit: what the work is counted in.
        amount: of that in a round.
        prepare: gets everything ready, and returns what does a round and tells the seconds that it took.
        beside: the bench to compare with, if any.
    """

    unit: str
    amount: int
    prepare: Callable[[ExitStack], Callable[[], float]]
    beside: str = ""


BENCHES: Final[Mapping[str, Bench]] = {
    "loop": Bench("s simulated", 1, partial(vehicles.prepare, PLAIN)),
    "loop-numba": Bench("s simulated", 1, partial(vehicles.prepare, NUMBA)),
    **{
        f"loop-{imus}-imus{ending}": Bench("s simulated", 1, partial(vehicles.prepare, kernel, imus=imus))
        for imus in (2, 3)
        for kernel, ending in ((PLAIN, ""), (NUMBA, "-numba"))
    },
    "message": Bench("messages", 100, partial(messages.prepare, 100), beside="parse"),
    "parse": Bench("messages", 100, messages.prepare_parse),
    "growth": Bench("messages", 10_000, partial(messages.prepare, 10_000), beside="message"),
    "log": Bench("records", logs.RECORDS, logs.prepare, beside="dfreader"),
    "dfreader": Bench("records", logs.RECORDS, logs.prepare_dfreader),
    "start": Bench("starts", 1, startup.prepare),
    "vio-640x480": Bench("frames", 1, partial(vio.prepare, 640, 480, 1)),
    "vio-5472x3648": Bench("frames", 1, partial(vio.prepare, 5472, 3648, 4)),
}
