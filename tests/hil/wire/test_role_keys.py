"""A folder of keys: what is missing in it, and what others may read."""

from __future__ import annotations

from pathlib import Path

import pytest

from hil.errors import UsageError
from hil.wire.role_keys import RoleKeys
from hil.wire.session import Endpoints
from tests.tls_labs import lab_keys


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    lab_keys(tmp_path / "keys")
    return tmp_path / "keys"


def test_whose_keys_are_missing_and_whose_are_there_is_said(folder: Path) -> None:
    for each in folder.iterdir():
        if not each.name.startswith(("ca", "viewer")):
            each.unlink()
    RoleKeys(folder, "viewer").check()
    with pytest.raises(UsageError, match=r"no operator\.pem.*it holds the keys of viewer"):
        RoleKeys(folder, "operator").check()


def test_a_folder_that_is_not_there_is_to_be_made(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="abreast secure init"):
        RoleKeys(tmp_path / "none", "operator").check()


@pytest.mark.parametrize("mode", [0o644, 0o640, 0o602])
def test_a_key_that_others_may_read_or_change_is_not_used(folder: Path, mode: int) -> None:
    keys = RoleKeys(folder, "controller")
    keys.secret.chmod(mode)
    with pytest.raises(UsageError, match=rf"{mode:04o}.*chmod 600"):
        Endpoints(connect="tls/127.0.0.1:7447", keys=keys)


def test_what_does_not_go_with_keys_is_refused(folder: Path) -> None:
    keys, router = RoleKeys(folder, "recorder"), RoleKeys(folder, "router")
    with pytest.raises(UsageError, match=r"expected a tls one.*tls/127\.0\.0\.1:7447"):
        Endpoints(connect="tcp/127.0.0.1:7447", keys=keys)
    with pytest.raises(UsageError, match="nobody listens but the router"):
        Endpoints(listen="tls/127.0.0.1:7447", keys=keys)
    with pytest.raises(UsageError, match="leave one of both out"):
        Endpoints(config_file=Path("some.json5"), keys=keys)
    assert Endpoints(listen="tls/0.0.0.0:7447", keys=router).joining == Endpoints(
        connect="tls/127.0.0.1:7447", keys=RoleKeys(folder, "operator")
    )


def test_daemons_are_told_the_folder_and_know_their_role_themselves(folder: Path) -> None:
    told = Endpoints(connect="tls/127.0.0.1:7447", keys=RoleKeys(folder, "operator"))
    assert told.options == ["--connect", "tls/127.0.0.1:7447", "--secure", str(folder)]
