# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The mission of a vehicle that flies none (AP_Mission/AP_Mission.cpp)."""


class Mission:
    """Holds home, the first item of every mission, and nothing else.

    Attributes:
        item_count: 1 once home is there, 0 before and after the mission was cleared.
        warned_of_request: the client was told to use MISSION_REQUEST_INT.
        warned_of_item: the client was told to use MISSION_ITEM_INT.
    """

    def __init__(self) -> None:
        self.item_count = 0
        self.warned_of_request = False
        self.warned_of_item = False

    def add_home(self) -> None:
        """Take home as the first item (AP_Mission::write_home_to_storage)."""
        self.item_count = 1

    def clear(self) -> None:
        """Forget all items; home comes back when it is set the next time (AP_Mission::clear)."""
        self.item_count = 0
