# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run benches, all or those that are named, each in processes of its own; pyperf's options say how long and where to.

Example: python -m tools.bench message parse -o speed.json
"""

from argparse import Namespace
from collections.abc import Callable
from contextlib import ExitStack
from functools import cache
from importlib.metadata import version

import pyperf

from tools.bench.table import BENCHES, Bench
from tools.measured_page import commit

PACKAGES = ("numpy", "pymavlink", "mypy")


def about() -> dict[str, str]:
    """Return what pyperf does not know of where figures come from: the commit, and the versions of packages."""
    return {"commit": commit(), "packages": ", ".join(f"{name} {version(name)}" for name in PACKAGES)}


def _rounds(bench: Bench, stack: ExitStack) -> Callable[[int], float]:
    prepared = cache(lambda: bench.prepare(stack))  # by the worker, when pyperf asks for the first value
    return lambda loops: sum(prepared()() for _ in range(loops))


def _pass_names_on(command: list[str], options: Namespace) -> None:
    command.extend(options.names)


def main() -> None:
    """Run the benches that the command line names."""
    program = ("-m", "tools.bench")
    runner = pyperf.Runner(
        values=5, processes=4, metadata=about(), program_args=program, add_cmdline_args=_pass_names_on
    )
    runner.argparser.add_argument("names", nargs="*", metavar="BENCH", help=f"any of {', '.join(BENCHES)}")
    names = runner.parse_args().names
    if unknown := set(names) - BENCHES.keys():
        runner.argparser.error(f"no such bench: {', '.join(sorted(unknown))}")
    for name, bench in BENCHES.items():
        if not names or name in names:
            with ExitStack() as stack:
                runner.bench_time_func(name, _rounds(bench, stack), inner_loops=bench.amount)


if __name__ == "__main__":
    main()
