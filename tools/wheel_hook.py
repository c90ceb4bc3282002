# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""Put the compiled filter into a wheel, where it can be compiled; hatchling loads this, as pyproject.toml says."""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from hatchling.builders.config import BuilderConfig
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PROGRAM = Path(__file__).with_name("compile_native.py")


class CompiledWheel(BuildHookInterface[BuilderConfig]):
    """Makes a wheel for this Python and machine; one for all, without compiled modules, where that fails."""

    _folder: TemporaryDirectory[str] | None = None

    def initialize(self, version_: str, build_data: dict[str, Any]) -> None:
        """Compile before a wheel is written; not for an editable checkout, which `tools/bootstrap.py` cares for."""
        if version_ == "editable":
            return
        package = self.config["package"]
        self._folder = TemporaryDirectory(prefix="viso-wheel-")
        command = [sys.executable, "-P", str(PROGRAM), self.root, package, self._folder.name]
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
        if done.returncode != 0:
            self.app.display_warning(f"a wheel without the compiled filter: {done.stdout.splitlines()[-1]}")
            return
        build_data["force_include"][self._folder.name] = package
        build_data["pure_python"] = False
        build_data["infer_tag"] = True
        build_data["dependencies"].append(f"librt>={version('librt')}")  # compiled code checks that it is not older

    def finalize(self, version_: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what has been compiled, once it is in the wheel."""
        if self._folder is not None:
            self._folder.cleanup()
