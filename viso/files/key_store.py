# SPDX-FileCopyrightText: 2026 The viso authors
# SPDX-License-Identifier: GPL-3.0-or-later
"""The signing key in a file that nobody else can read; its contents are never shown or logged."""

import logging
from pathlib import Path
from typing import Final

from mav_handlers.signing import SigningKey
from viso.errors import InputError
from viso.files.outputs import remove_stale_drafts, replace_file

_log = logging.getLogger(__name__)

_OWNER_ONLY: Final = 0o600
_STORED_BYTES: Final = len(SigningKey(0, b"").to_bytes())


class KeyStoreError(InputError):
    """A file of a signing key cannot be used; the text is one line that names the file."""


class FileKeyStore:
    """Keeps the key over a restart of the process: the 48 bytes that the firmware stores, in a file of their own.

    The file is read once, here, and replaced as a whole whenever the key or its timestamp is saved. Saving never
    raises because of the file system: the first error is logged, further ones are not until a save succeeds. The file
    need not exist; its folder is made when something is saved.

    Attributes:
        failure: why the last save failed, in one line naming the file; None while all is well.

    Raises:
        KeyStoreError: the file cannot be read, or holds no key.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.failure: str | None = None
        self._data = self._read()
        remove_stale_drafts(path)

    def _read(self) -> bytes:
        try:
            data = self._path.read_bytes()
        except FileNotFoundError:
            return b""
        except OSError as error:
            raise KeyStoreError(f"{self._path}: {error.strerror or error}") from error
        if len(data) != _STORED_BYTES or SigningKey.from_bytes(data) is None:
            raise KeyStoreError(f"{self._path}: not a signing key; without the file there is no signing")
        return data

    def load(self) -> bytes:
        """Return what was saved, or nothing."""
        return self._data

    def save(self, data: bytes) -> bool:
        """Keep these bytes; say whether that worked."""
        try:
            replace_file(self._path, data, mode=_OWNER_ONLY)
        except OSError as error:
            was_reported = self.failure is not None
            self.failure = f"{self._path}: the signing key cannot be stored: {error.strerror or error}"
            if not was_reported:
                _log.error("%s", self.failure)
            return False
        self._data = data
        self.failure = None
        return True
