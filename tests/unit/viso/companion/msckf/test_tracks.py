# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Tracks: when they are used, and that no sighting is used twice."""

from collections import Counter
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from viso.companion.msckf.tracks import MOST_TRACKS, RIPE, TrackBook, padded

Used = list[dict[int, tuple[float, float]]]


def place(point: int, number: int) -> tuple[float, float]:
    return point + 0.001 * number, -float(number)


def note(book: TrackBook, number: int, points: Iterable[int]) -> Used:
    ids = list(points)
    return book.note(number, ids, [place(point, number) for point in ids])


def frames_of(used: Used) -> list[list[int]]:
    return [list(track) for track in used]


def test_track_is_used_when_its_point_is_lost() -> None:
    book = TrackBook(3)
    for number in (1, 2, 3):
        assert note(book, number, [7, 8]) == []
    (track,) = note(book, 4, [8])
    assert track == {number: place(7, number) for number in (1, 2, 3)}


def test_track_that_says_nothing_is_not_used() -> None:
    book = TrackBook(3)
    note(book, 1, [7])
    note(book, 2, [7])
    assert note(book, 3, []) == []


def test_two_sightings_are_enough_on_a_plane() -> None:
    book = TrackBook(2)
    note(book, 1, [7])
    note(book, 2, [7])
    assert frames_of(note(book, 3, [])) == [[1, 2]]


def test_track_is_used_when_ripe_and_begins_anew() -> None:
    book = TrackBook(3)
    used = [note(book, number, [7]) for number in range(1, 2 * RIPE + 1)]
    assert [index for index, tracks in enumerate(used, 1) if tracks] == [RIPE, 2 * RIPE]
    assert frames_of(used[-1]) == [list(range(RIPE + 1, 2 * RIPE + 1))]


def test_ripeness_is_what_it_is_told_to_be_but_never_less_than_enough() -> None:
    book, strict = TrackBook(2, ripe=4), TrackBook(3, ripe=2)
    assert [bool(note(book, number, [7])) for number in range(1, 5)] == [False, False, False, True]
    assert [bool(note(strict, number, [7])) for number in range(1, 4)] == [False, False, True]


def test_longest_tracks_come_first_up_to_the_most() -> None:
    book = TrackBook(3)
    note(book, 1, range(30))
    for number in (2, 3, 4):
        note(book, number, range(80))
    used = note(book, 5, [])
    assert [len(track) for track in used] == [4] * 30 + [3] * (MOST_TRACKS - 30)


def test_ripe_track_that_had_no_room_goes_on() -> None:
    book = TrackBook(3)
    for number in range(1, RIPE):
        note(book, number, range(60))
    assert len(note(book, RIPE, range(60))) == MOST_TRACKS
    late = note(book, RIPE + 1, range(60))
    assert frames_of(late) == [list(range(1, RIPE + 2))] * (60 - MOST_TRACKS)


def test_forgotten_frame_is_in_no_track() -> None:
    book = TrackBook(3)
    for number in (1, 2, 3, 4):
        note(book, number, [7])
    book.drop(1)
    assert frames_of(note(book, 5, [])) == [[2, 3, 4]]


def test_point_that_comes_back_begins_anew() -> None:
    book = TrackBook(2)
    note(book, 1, [7])
    note(book, 2, [])
    note(book, 3, [7])
    note(book, 4, [7])
    assert frames_of(note(book, 5, [])) == [[3, 4]]


@pytest.mark.slow
@given(st.lists(st.sets(st.integers(0, 70), max_size=70), min_size=1, max_size=25), st.sampled_from([2, 3]))
def test_no_sighting_is_used_twice_or_made_up(frames: list[set[int]], fewest: int) -> None:
    book, used = TrackBook(fewest), Counter[tuple[int, int]]()
    for number, points in enumerate(frames):
        for track in note(book, number, sorted(points)):
            assert fewest <= len(track)
            (point,) = {round(u - 0.001 * frame) for frame, (u, _) in track.items()}
            assert all(seen == place(point, frame) for frame, seen in track.items())
            used.update((point, frame) for frame in track)
    assert not used or max(used.values()) == 1
    assert all(point in frames[frame] for point, frame in used)


def test_points_of_long_ago_are_not_remembered() -> None:
    book = TrackBook(3)
    for number in range(500):
        note(book, number, range(number, number + 20))
    assert len(book._open) == 20


def test_arrays_hold_the_tracks() -> None:
    tracks = [{3: (0.1, 0.2), 5: (0.3, 0.4), 9: (0.5, 0.6)}, {5: (0.7, 0.8), 9: (0.9, 1.0)}]
    arrays = padded(tracks, {3: 0, 5: 1, 9: 2})
    assert arrays.clones.tolist() == [[0, 1, 2], [1, 2, 0]]
    assert arrays.seen.tolist() == [[True, True, True], [True, True, False]]
    assert arrays.normalised.tolist() == [[[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], [[0.7, 0.8], [0.9, 1.0], [0.0, 0.0]]]
    assert len(arrays) == 2


def test_no_tracks_are_empty_arrays() -> None:
    assert padded([], {}).normalised.shape == (0, 0, 2)


def test_sighting_from_a_pose_that_is_not_there_is_an_error() -> None:
    with pytest.raises(KeyError):
        padded([{3: (0.1, 0.2)}], {4: 0})
