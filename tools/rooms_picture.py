# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw the rooms of the packages as the contracts of import-linter have them: layers from top to bottom."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

GAP: Final = 6
PAD: Final = 10
TITLE: Final = 24
HEIGHT: Final = 28
LETTER: Final = 8.0  # px, what a letter takes at most on average, bold ones included
CAPTION: Final = "A room may import what stands below it, never what stands beside or above it."
# Fill and line: of the picture, of packages, of frames in them; other rooms are white.
FRAMES: Final = (("#ffffff", "#ffffff"), ("#e3ecf7", "#7d9cc4"), ("#fdf1dc", "#d0a75c"))
ROOM: Final = ("#ffffff", "#a9b3bf")


@dataclass(frozen=True)
class Room:
    """A room, or a frame with layers of rooms in it; sizes are the least it needs, in px."""

    name: str
    layers: tuple[tuple[Room, ...], ...]

    @property
    def width(self) -> float:
        """The least width: that of the widest layer, or of the name."""
        rows = (sum(room.width for room in layer) + GAP * (len(layer) - 1) for layer in self.layers)
        return max(len(self.name) * LETTER + 2 * PAD, max(rows, default=0) + 2 * PAD * bool(self.layers))

    @property
    def height(self) -> float:
        """The least height: the title and all layers, each as high as its highest room."""
        rows = [max(room.height for room in layer) for layer in self.layers]
        return TITLE + sum(rows) + GAP * (len(rows) - 1) + PAD if rows else HEIGHT


def rooms(importlinter: Mapping[str, Any]) -> Room:
    """Return the whole house from the table `tool.importlinter` of pyproject.toml."""
    plans = {
        container: contract["layers"]
        for contract in importlinter["contracts"]
        for container in contract.get("containers", [""])
        if contract["type"] == "layers"
    }

    def room(path: str) -> Room:
        inside = [[part.strip() for part in layer.split("|")] for layer in plans.get(path, ())]
        layers = tuple(tuple(room(f"{path}.{name}".lstrip(".")) for name in layer) for layer in inside)
        return Room(path.rpartition(".")[2], layers)

    return room("")


def draw(house: Room) -> str:
    """Return the house as an SVG picture."""
    width, height = house.width, house.height
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="Verdana, DejaVu Sans, sans-serif" font-size="12">'
    )
    caption = f'<text x="{width / 2:.0f}" y="17" text-anchor="middle" fill="#555">{CAPTION}</text>'
    return "\n".join([head, *_drawn(house, 0, 0, width, height, 0), caption, "</svg>", ""])


def _drawn(room: Room, x: float, y: float, width: float, height: float, depth: int) -> Iterator[str]:
    fill, line = FRAMES[depth] if room.layers or depth == 1 else ROOM
    bold = ' font-weight="bold"' if room.layers or depth == 1 else ""
    place = f'x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"'
    yield f'<rect {place} rx="4" fill="{fill}" stroke="{line}"/>'
    if not room.layers:
        middle = f'x="{x + width / 2:.1f}" y="{y + height / 2 + 4:.1f}" text-anchor="middle"'
        yield f"<text {middle}{bold}>{room.name}</text>"
        return
    if room.name:
        yield f'<text x="{x + PAD:.1f}" y="{y + 17:.1f}"{bold}>{room.name}</text>'
    top = y + TITLE
    for layer in room.layers:
        high = max(one.height for one in layer)
        free = width - 2 * PAD - GAP * (len(layer) - 1) - sum(one.width for one in layer)
        takers = [one for one in layer if one.layers] or layer
        left = x + PAD
        for one in layer:
            wide = one.width + (free / len(takers) if one in takers else 0)
            yield from _drawn(one, left, top, wide, high, depth + 1)
            left += wide + GAP
        top += high + GAP
