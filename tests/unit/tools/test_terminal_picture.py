# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of terminals need nothing but themselves."""

from tools.terminal_picture import picture


def test_picture_shows_output_and_command_without_a_font_from_a_network() -> None:
    svg = picture("\x1b[31merror\x1b[0m XN3-02\n", "viso doctor flight")
    assert ">error<" in svg
    assert "viso&#160;doctor&#160;flight" in svg
    assert "url(http" not in svg
