# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The option of live topics."""

from typing import Annotated

import typer

DomainOption = Annotated[
    int, typer.Option("--domain", envvar="ROS_DOMAIN_ID", help="Of a live topic: the domain of DDS.", metavar="ID")
]
