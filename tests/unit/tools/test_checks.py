# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The check runner reads pytest's counts and sums up."""

import os
import sys
from functools import partial
from pathlib import Path

import pytest

from tools import checks
from tools.checks import Result, Run, Step

REPORT = '<testsuites><testsuite tests="10" failures="2" errors="1" skipped="3"/></testsuites>'


def _run(everything: bool = False) -> Run:
    return Run(everything, Path("no-such-folder"))


def _pytest_commands(everything: bool) -> list[list[str]]:
    return next(step for step in checks.STEPS if step.name == "tests").commands(_run(everything))


def test_counts_come_from_the_junit_report(tmp_path: Path) -> None:
    report = tmp_path / "tests.xml"
    report.write_text(REPORT, encoding="utf-8")
    assert checks.count_tests(tmp_path) == {"passed": 4, "failed": 3, "skipped": 3}


def test_missing_or_broken_report_gives_no_counts(tmp_path: Path) -> None:
    report = tmp_path / "tests.xml"
    assert checks.count_tests(tmp_path) == {}
    report.write_text("<testsuites>", encoding="utf-8")
    assert checks.count_tests(tmp_path) == {}


def test_last_line_holds_the_tests_counts() -> None:
    results = [Result("lint", "FAIL", 1.0), Result("tests", "ok", 2.0)]
    lines = checks.closing_lines(results, {"passed": 4, "failed": 0, "skipped": 1}, 2.5)
    assert lines[-1] == "4 passed, 0 failed, 1 skipped in 2.5s"
    assert "FAIL  lint         1.0 s" in lines


def test_without_tests_the_last_line_counts_steps() -> None:
    results = [Result("lint", "FAIL", 1.0), Result("types", "ok", 1.0), Result("docs", "skip", 0.0)]
    assert checks.closing_lines(results, {}, 2.0)[-1] == "1 passed, 1 failed in 2.0s"


def test_slow_and_interop_tests_run_only_when_everything_is_asked_for() -> None:
    (usual,) = _pytest_commands(everything=False)
    assert "not slow and not interop" in usual
    assert not [command for command in _pytest_commands(everything=True) if "-m" in command[3:]]


def test_coverage_is_measured_on_the_packages_with_a_threshold() -> None:
    covered, others = _pytest_commands(everything=True)
    measured = [option.removeprefix("--cov=") for option in covered if option.startswith("--cov=")]
    assert measured == list(checks.LEAST_COVERAGE)
    assert not [
        option for command in (others, *_pytest_commands(everything=False)) for option in command if "--cov" in option
    ]


def _pure_commands(everything: bool) -> list[list[str]]:
    return next(step for step in checks.STEPS if step.name == "pure").commands(_run(everything))


def test_parity_tests_run_with_the_interpreted_filter_too_when_everything_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(checks, "IS_COMPILED", True)
    (command,) = _pure_commands(everything=True)
    assert command[:2] == ["env", "VISO_PURE=1"]
    assert "tests/parity" in command
    assert _pure_commands(everything=False) == []


def test_nothing_runs_twice_where_the_filter_is_not_compiled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, "IS_COMPILED", False)
    assert _pure_commands(everything=True) == []


def test_every_test_runs_once_when_everything_is_asked_for() -> None:
    covered, others = _pytest_commands(everything=True)
    paths = [option for option in covered if option.startswith("tests/")]
    assert paths == [option.removeprefix("--ignore=") for option in others if option.startswith("--ignore=")]
    assert all((checks.ROOT / path).is_dir() for path in paths)


def test_counts_of_several_reports_add_up(tmp_path: Path) -> None:
    for name in ("covered.xml", "others.xml"):
        (tmp_path / name).write_text(REPORT)
    assert checks.count_tests(tmp_path) == {"passed": 8, "failed": 6, "skipped": 6}


@pytest.mark.parametrize(("codes", "state"), [((0, 0), "ok"), ((3, 0), "FAIL"), ((), "skip")])
def test_state_of_a_step_follows_its_commands(codes: tuple[int, ...], state: str) -> None:
    step = Step("x", "x", lambda run: [[sys.executable, "-c", f"exit({code})"] for code in codes])
    assert checks.run_step(step, _run()).state == state


def test_unknown_step_is_a_usage_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        checks.main(["lint", "nonsense"])
    assert "no such step: nonsense" in capsys.readouterr().err


def test_help_lists_every_step(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="0"):
        checks.main(["--help"])
    text = capsys.readouterr().out
    assert all(step.name in text for step in checks.STEPS)


@pytest.mark.parametrize(("failing", "code"), [(False, 0), (True, 1)])
def test_exit_code_tells_whether_a_step_failed(failing: bool, code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = (
        Step("one", "x", lambda run: [[sys.executable, "-c", f"exit({int(failing)})"]]),
        Step("two", "x", lambda run: [[sys.executable, "-c", ""]]),
    )
    monkeypatch.setattr(checks, "STEPS", steps)
    assert checks.main([]) == code


def test_others_run_beside_the_tests_and_are_told_in_one_piece(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)  # which opens for one when it does for the other
    programs = {"lint": f"print(open({str(pipe)!r}).read())", "tests": f"open({str(pipe)!r}, 'w').write('met')"}
    steps = [Step(name, "x", partial(_python, program)) for name, program in programs.items()]
    monkeypatch.setattr(checks, "STEPS", steps)
    assert checks.main([]) == 0
    output = capfd.readouterr().out
    assert "\n== lint: x\nmet\n-- lint ok, " in output
    assert output.index("ok    lint ") < output.index("ok    tests ")


def _python(program: str, run: Run) -> list[list[str]]:
    return [[sys.executable, "-c", program]]


@pytest.mark.parametrize(("ci", "args", "everything"), [("true", [], True), ("", [], False), ("", ["--all"], True)])
def test_all_tests_run_on_request_and_in_ci(
    ci: str, args: list[str], everything: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[bool] = []

    def commands(run: Run) -> list[list[str]]:
        seen.append(run.everything)
        return []

    monkeypatch.setattr(checks, "STEPS", (Step("one", "x", commands),))
    monkeypatch.setenv("CI", ci)
    checks.main(args)
    assert seen == [everything]
