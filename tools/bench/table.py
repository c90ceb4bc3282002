# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The benches: one row each."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from typing import Final, NamedTuple

from tools.bench import commands, filter, logs, messages, startup, vehicles, vio
from tools.bench.interpreted import interpreted


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
    "filter": Bench("frames", filter.FRAMES, partial(filter.prepare, 1)),
    "filter-2-cores": Bench("frames", filter.FRAMES, partial(filter.prepare, 2)),
    "filter-3-cores": Bench("frames", filter.FRAMES, partial(filter.prepare, 3)),
    "filter-interpreted": Bench("frames", filter.FRAMES, partial(interpreted, partial(filter.prepare, 1))),
    "loop": Bench("s simulated", 1, vehicles.prepare),
    "loop-interpreted": Bench("s simulated", 1, partial(interpreted, vehicles.prepare)),
    "loop-2-imus": Bench("s simulated", 1, partial(vehicles.prepare, imus=2)),
    "loop-2-imus-interpreted": Bench("s simulated", 1, partial(interpreted, partial(vehicles.prepare, imus=2))),
    "loop-3-imus": Bench("s simulated", 1, partial(vehicles.prepare, imus=3)),
    "ekf": Bench("flights", 1, commands.prepare_ekf, beside="ekf-dfreader"),
    "ekf-dfreader": Bench("flights", 1, commands.prepare_dfreader),
    "doctor": Bench("flights", 1, commands.prepare_doctor),
    "idle": Bench("s", commands.IDLE_S, commands.prepare_idle),
    "message": Bench("messages", 100, partial(messages.prepare, 100), beside="parse"),
    "parse": Bench("messages", 100, messages.prepare_parse),
    "growth": Bench("messages", 10_000, partial(messages.prepare, 10_000), beside="message"),
    "log": Bench("records", logs.RECORDS, logs.prepare, beside="dfreader"),
    "dfreader": Bench("records", logs.RECORDS, logs.prepare_dfreader),
    "start": Bench("starts", 1, startup.prepare),
    "vio-640x480": Bench("frames", 1, partial(vio.prepare, 640, 480, 1)),
    "vio-5472x3648": Bench("frames", 1, partial(vio.prepare, 5472, 3648, 4)),
}
