# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The quaternion that the filter uses is numpy-quaternion's own, or one in Python."""

import subprocess
import sys

import quaternion

from ekf_stub.filter import quaternions


def test_it_is_that_of_the_package() -> None:
    assert quaternions.quaternion is quaternion.quaternion
    assert (quaternions.one, quaternions.zero) == (quaternion.one, quaternion.zero)


def test_without_the_package_the_one_in_python_takes_its_place() -> None:
    program = "import sys; sys.modules['quaternion'] = None\nfrom ekf_stub.filter import quaternions as ours\n"
    program += "assert ours.IS_PLAIN and ours.quaternion.__module__ == 'ekf_stub.filter.plain_quaternion'"
    subprocess.run([sys.executable, "-c", program], check=True, timeout=60)
