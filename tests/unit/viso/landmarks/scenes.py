# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of synthetic flights, for tests of what is made of them."""

from collections.abc import Iterable

from viso.landmarks.local_frame import FrameMode
from viso.landmarks.scene import Scene
from viso.landmarks.session import Session, Settings
from viso.landmarks.synthetic import SyntheticFlight
from viso.landmarks.types import Event


def scenes_of(session: Session, events: Iterable[Event]) -> list[Scene]:
    """Return all scenes that a session makes of events."""
    return [scene for event in events for scene in session.take(event)] + session.finish()


def flown(flight: SyntheticFlight, *more: Event, **settings: object) -> list[Scene]:
    """Return the scenes of a flight, after some more events."""
    session = Session(Settings(camera=flight.camera, mode=FrameMode.SPHERICAL, **settings))  # type: ignore[arg-type]
    return scenes_of(session, [*more, *flight.events()])
