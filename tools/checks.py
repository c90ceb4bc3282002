# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the project's checks, the tests beside all others, and sum them up; `tools/check` starts this."""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from ap_core.native import PURE_VARIABLE
from ekf_stub.core import IS_COMPILED

ROOT = Path(__file__).resolve().parent.parent
Command = list[str]

# Percent of branches; and the tests that are meant to reach them.
LEAST_COVERAGE = {"ap_visualodom": 100, "ap_core": 95, "mav_handlers": 95}
COVERING_TESTS = ("tests/contract", *(f"tests/unit/{package}" for package in LEAST_COVERAGE))


@dataclass(frozen=True)
class Run:
    """One call of `tools/check`: whether slow and interop tests count, and the folder where pytest leaves counts."""

    everything: bool
    counts: Path


@dataclass(frozen=True)
class Step:
    """A check: its name, what it does in a few words, and the commands it consists of."""

    name: str
    about: str
    commands: Callable[[Run], list[Command]]


@dataclass(frozen=True)
class Result:
    """How a step ended: `ok`, `FAIL` or `skip`, after how many seconds."""

    name: str
    state: str
    seconds: float


def _program(name: str, *args: str) -> Command:
    return [str(Path(sys.executable).parent / name), *args]


def _module(name: str, *args: str) -> Command:
    return [sys.executable, "-m", name, *args]


def _fixed(*commands: Command) -> Callable[[Run], list[Command]]:
    return lambda run: list(commands)


def _clients(run: Run) -> list[Command]:
    return [_module("tools.interop_environment", "--set-up")] if run.everything else []


def _pytest(run: Run, name: str, *options: str) -> Command:
    return _module("pytest", "-n", "2", f"--junit-xml={run.counts / name}.xml", *options)


def _tests(run: Run) -> list[Command]:
    if not run.everything:
        return [_pytest(run, "usual", "-m", "not slow and not interop")]
    # Measuring makes tests take five times as long, so only the packages' own tests are measured, and only on them.
    packages = [f"--cov={package}" for package in LEAST_COVERAGE]
    covered = _pytest(run, "covered", *packages, "--cov-branch", "--cov-report=", *COVERING_TESTS)
    # One run for all others, of twice as many workers as cores: half of them wait for real clients and for the clock.
    others = [f"--ignore={path}" for path in COVERING_TESTS]
    return [covered, _pytest(run, "others", "-n", "4", "--durations=30", *others)]


def _pure(run: Run) -> list[Command]:
    # All other tests take the compiled filter; what the recordings say must be true of its source as well.
    tests = _pytest(run, "pure", "-m", "not slow and not interop", "tests/parity")
    return [["env", f"{PURE_VARIABLE}=1", *tests]] if run.everything and IS_COMPILED else []


def _coverage(run: Run) -> list[Command]:
    least = LEAST_COVERAGE if run.everything else {}
    return [
        _module("coverage", "report", f"--include={package}/*", f"--fail-under={percent}")
        for package, percent in least.items()
    ]


STEPS = (
    Step("format", "ruff format --check", _fixed(_program("ruff", "format", "--check", "."))),
    Step("lint", "ruff check: style, SPDX lines, banned names", _fixed(_program("ruff", "check", "."))),
    Step("types", "mypy, strict", _fixed(_module("mypy"))),
    Step("layers", "who may import whom, and no circles", _fixed(_program("lint-imports", "--no-logo"))),
    Step("traces", "registry hosts and machine paths", _fixed(_module("tools.check_traces"))),
    Step("prose", "plain English in pages and docstrings", _fixed(_module("tools.prose"))),
    Step(
        "docs",
        "generated tables and code are current",
        _fixed(*([sys.executable, f"tools/{name}.py", "--check"] for name in ("make_docs", "make_messages"))),
    ),
    Step("clients", "the environment of the interop tests", _clients),
    Step("tests", "pytest, with everything also branch coverage", _tests),
    Step("pure", "the parity tests with the interpreted filter", _pure),
    Step("coverage", "thresholds for each package", _coverage),
)


# The tests, what they need and what is made of them: one after the other, while the others run beside.
TESTING = {"clients", "tests", "pure", "coverage"}


def _environment() -> dict[str, str]:
    # Tests start hundreds of processes: without compiled modules each takes more than a second longer.
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}


def run_step(step: Step, run: Run, *, beside: bool = False) -> Result:
    """Run all commands of a step and return how it went.

    Their output goes straight to ours; of a step that runs `beside` others it comes in one piece when the step ends.
    """
    commands = step.commands(run)
    title = f"\n== {step.name}: {step.about}"
    if not beside:
        print(title, flush=True)
    out, err = (subprocess.PIPE, subprocess.STDOUT) if beside else (None, None)
    started = time.monotonic()
    done = [
        subprocess.run(command, cwd=ROOT, env=_environment(), check=False, text=True, stdout=out, stderr=err)
        for command in commands
    ]
    state = ("FAIL" if any(one.returncode for one in done) else "ok") if done else "skip"
    result = Result(step.name, state, time.monotonic() - started)
    told = [title, "\n", *(one.stdout for one in done)] if beside else []
    print("".join(told) + f"-- {result.name} {result.state}, {result.seconds:.1f} s", flush=True)
    return result


def run_steps(steps: Sequence[Step], run: Run) -> list[Result]:
    """Run steps and return how each went; those that are no tests run beside the tests, which leave time for them."""
    testing = [step for step in steps if step.name in TESTING]
    others = [step for step in steps if step.name not in TESTING]
    if not testing:
        return [run_step(step, run) for step in others]
    with ThreadPoolExecutor(1) as pool:
        beside = [pool.submit(run_step, step, run, beside=True) for step in others]
        try:
            results = [run_step(step, run) for step in testing]
            return [*(one.result() for one in beside), *results]
        except KeyboardInterrupt:
            pool.shutdown(cancel_futures=True)
            raise


def _suites(folder: Path) -> list[ElementTree.Element]:
    suites: list[ElementTree.Element] = []
    for report in sorted(folder.glob("*.xml")):
        with contextlib.suppress(OSError, ElementTree.ParseError):
            suites += ElementTree.parse(report).getroot().iter("testsuite")
    return suites


def count_tests(folder: Path) -> dict[str, int]:
    """Return pytest's counts from the JUnit reports in a folder: passed, failed, skipped; empty when there is none.

    Errors in fixtures and collection count as failed, expected failures as skipped.
    """
    suites = _suites(folder)
    counts = {"passed": 0, "failed": 0, "skipped": 0} if suites else {}
    for suite in suites:
        failed = int(suite.get("failures", 0)) + int(suite.get("errors", 0))
        skipped = int(suite.get("skipped", 0))
        counts["failed"] += failed
        counts["skipped"] += skipped
        counts["passed"] += int(suite.get("tests", 0)) - failed - skipped
    return counts


def closing_lines(results: Sequence[Result], counts: dict[str, int], seconds: float) -> list[str]:
    """Return the summary: a line for each step, then the counts of tests (else of steps) and the whole time."""
    lines = ["", "== summary"]
    lines += [f"{result.state:4}  {result.name:9} {result.seconds:6.1f} s" for result in results]
    if not counts:
        failed = sum(result.state == "FAIL" for result in results)
        counts = {"passed": sum(result.state == "ok" for result in results), "failed": failed}
    return [*lines, ", ".join(f"{number} {what}" for what, number in counts.items()) + f" in {seconds:.1f}s"]


def _parser() -> argparse.ArgumentParser:
    width = max(len(step.name) for step in STEPS)
    steps = "\n".join(f"  {step.name:{width}}  {step.about}" for step in STEPS)
    parser = argparse.ArgumentParser(
        prog="tools/check",
        description="Run the project's checks, all of them or the named ones.",
        epilog=f"steps:\n{steps}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("steps", nargs="*", metavar="STEP", help="run only these, in their usual order")
    parser.add_argument("--all", action="store_true", help="with slow and interop tests (default when CI=true)")
    return parser


def main(args: Sequence[str]) -> int:
    """Run the checks; return 1 when one failed, 2 on a wrong command line."""
    parser = _parser()
    options = parser.parse_args(args)
    unknown = set(options.steps) - {step.name for step in STEPS}
    if unknown:
        parser.error(f"no such step: {', '.join(sorted(unknown))}")
    chosen = [step for step in STEPS if not options.steps or step.name in options.steps]
    with tempfile.TemporaryDirectory(prefix="viso-check-") as folder:
        everything = options.all or os.environ.get("CI", "").lower() == "true"
        run = Run(everything, Path(folder))
        started = time.monotonic()
        results = run_steps(chosen, run)
        lines = closing_lines(results, count_tests(run.counts), time.monotonic() - started)
        print("\n".join(lines), flush=True)
    return 1 if any(result.state == "FAIL" for result in results) else 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
