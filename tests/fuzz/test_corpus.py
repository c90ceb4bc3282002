# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""What fuzzing has found stays found: every input of the corpus goes through its target again."""

import gc
import random
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.fuzz import endpoint_target, file_target
from tests.places import ROOT

# DFReader leaves a log open that it cannot read.
pytestmark = pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")

CORPUS = ROOT / "tests" / "fuzz" / "corpus"
Target = Callable[[bytes, Path], None]


@pytest.fixture(scope="module", autouse=True)
def open_files() -> Iterator[None]:
    """Let go of files here that were left open, not in somebody else's test."""
    yield
    gc.collect()


def inputs(name: str) -> list[Path]:
    """Return the files of a corpus."""
    return sorted((CORPUS / name).iterdir())


@pytest.mark.parametrize("path", inputs("endpoint"), ids=lambda path: path.name)
def test_vehicle_stands_an_input_of_the_corpus(path: Path, tmp_path: Path) -> None:
    endpoint_target.run(path.read_bytes(), tmp_path)


@pytest.mark.parametrize("path", inputs("files"), ids=lambda path: path.name)
def test_readers_stand_an_input_of_the_corpus(path: Path, tmp_path: Path) -> None:
    file_target.run(path.read_bytes(), tmp_path)


def mutated(data: bytes, source: random.Random) -> bytes:
    """Change, lose and repeat a few bytes, as a fuzzer does without knowing anything."""
    changed = bytearray(data)
    for _ in range(source.randrange(1, 6)):
        at = source.randrange(len(changed) + 1)
        how = source.randrange(3)
        if how == 0 and at < len(changed):
            changed[at] = source.randrange(256)
        elif how == 1:
            del changed[at : at + source.randrange(1, 8)]
        else:
            changed[at:at] = changed[at : at + source.randrange(1, 30)]
    return bytes(changed)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "target", "rounds"),
    [
        ("endpoint", endpoint_target.run, 200),
        ("files", file_target.run, 1000),
    ],
)
def test_inputs_near_the_corpus_are_stood_too(name: str, target: Target, rounds: int, tmp_path: Path) -> None:
    source = random.Random(name)
    seeds = [path.read_bytes() for path in inputs(name)]
    for _ in range(rounds):
        target(mutated(source.choice(seeds), source), tmp_path)
