"""A folder of keys, as ``abreast secure init`` makes it: whose files lie where, and whether they are safe."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import NamedTuple

from hil.errors import UsageError
from hil.wire.roles import ROLES, Role

AUTHORITY = "ca.pem"
"""Certificate of the authority that all others are of; its key is kept nowhere."""

_OTHERS = stat.S_IRWXG | stat.S_IRWXO


class RoleKeys(NamedTuple):
    """A folder of keys, and the role in which a session uses it: its certificate's common name."""

    folder: Path
    role: Role

    @property
    def authority(self) -> Path:
        """Certificate of the authority."""
        return self.folder / AUTHORITY

    @property
    def certificate(self) -> Path:
        """Certificate of the role."""
        return self.folder / f"{self.role}.pem"

    @property
    def secret(self) -> Path:
        """Secret key of the role."""
        return self.folder / f"{self.role}.key"

    @property
    def config(self) -> Path:
        """Zenoh configuration of the role."""
        return self.folder / f"{self.role}.json5"

    def check(self) -> None:
        """Raise :class:`UsageError` for files that are not there, or a secret that others may read."""
        for path in (self.authority, self.certificate, self.secret, self.config):
            if not path.is_file():
                raise UsageError(
                    f"--secure {self.folder}: there is no {path.name}, expected the files of "
                    f"{self.role}; {self._instead()}"
                )
        mode = self.secret.stat().st_mode
        if mode & _OTHERS:
            raise UsageError(
                f"--secure {self.folder}: {self.secret.name} has mode {stat.S_IMODE(mode):04o}, so that "
                f"others may read or change it, expected 0600; chmod 600 {self.secret}"
            )

    def _instead(self) -> str:
        there = [role for role in ROLES if (self.folder / f"{role}.key").is_file()]
        if there:
            return f"it holds the keys of {', '.join(there)}: copy those of {self.role} to it"
        return f"make one with abreast secure init {self.folder}"
