# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The report on the links."""

from viso.vehicle.ftp import UartCounts, UartsText


class Links:
    """Links whose counts and clock the test sets."""

    def __init__(self) -> None:
        self.now_us = 0
        self.counts: list[UartCounts] = []
        self.text = UartsText(lambda: self.counts, lambda: self.now_us)


def test_report_has_a_header_and_a_line_for_each_link() -> None:
    links = Links()
    links.now_us = 2_000_000
    links.counts = [UartCounts(1000, 20, True, "tcp:0"), UartCounts(0, 0, False, "udp:1")]
    assert links.text() == (
        "UARTV1\n"
        "SERIAL0 TX=    1000 RX=      20 TXBD=  5000 RXBD=   100 connected     (tcp:0)\n"
        "SERIAL1 TX=       0 RX=       0 TXBD=     0 RXBD=     0 not connected (udp:1)\n"
    )


def test_amounts_are_since_the_last_report() -> None:
    links = Links()
    links.counts = [UartCounts(1000, 20, True, "tcp:0")]
    links.text()
    links.now_us = 1_000_000
    links.counts = [UartCounts(1005, 120, True, "tcp:0"), UartCounts(7, 7, True, "new")]
    assert links.text().splitlines()[1:] == [
        "SERIAL0 TX=       5 RX=     100 TXBD=    50 RXBD=  1000 connected     (tcp:0)",
        "SERIAL1 TX=       7 RX=       7 TXBD=    70 RXBD=    70 connected     (new)",
    ]


def test_two_reports_in_the_same_millisecond_do_not_divide_by_0() -> None:
    links = Links()
    links.counts = [UartCounts(1, 1, True, "tcp:0")]
    assert "TXBD= 10000" in links.text()
