"""Keys of a lab: what is made, who may read it, and what is refused."""

from __future__ import annotations

import datetime
import ipaddress
import json
import stat
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID
from cryptography.x509.verification import PolicyBuilder, Store

from hil.errors import UsageError
from hil.live.tls_keys import Deployment, make_keys
from hil.scenario.files import load_scenario
from hil.wire.role_keys import RoleKeys
from hil.wire.roles import ROLES, ROUTER
from tests.tls_labs import NOW, lab_keys

TURTLEBOT3 = load_scenario("turtlebot3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lab") / "keys"
    wanted = Deployment(TURTLEBOT3, hosts=("lab.example", "192.0.2.10", "2001:db8::7"), days=30)
    make_keys(folder, wanted, now=NOW)
    return folder


def certificate(path: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(path.read_bytes())


def test_a_certificate_says_the_role_and_nobody_else_can_read_its_key(folder: Path) -> None:
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    for role in ROLES:
        keys = RoleKeys(folder, role)
        keys.check()
        assert stat.S_IMODE(keys.secret.stat().st_mode) == 0o600
        made, secret = certificate(keys.certificate), load_pem_private_key(keys.secret.read_bytes(), None)
        assert [each.value for each in made.subject.get_attributes_for_oid(NameOID.COMMON_NAME)] == [role]
        assert secret.public_key() == made.public_key()
        assert (
            made.not_valid_before_utc <= NOW < made.not_valid_after_utc <= NOW + datetime.timedelta(days=30)
        )


def test_only_the_routers_is_that_of_a_server_and_it_is_for_where_the_router_is(folder: Path) -> None:
    for role in ROLES:
        made = certificate(RoleKeys(folder, role).certificate)
        purposes = list(made.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value)
        server = role == ROUTER
        assert purposes == [ExtendedKeyUsageOID.SERVER_AUTH if server else ExtendedKeyUsageOID.CLIENT_AUTH]
    authority = Store([certificate(folder / "ca.pem")])
    router = certificate(RoleKeys(folder, ROUTER).certificate)
    names: list[x509.DNSName | x509.IPAddress] = [x509.DNSName("localhost"), x509.DNSName("lab.example")]
    names += [
        x509.IPAddress(ipaddress.ip_address(each)) for each in ("127.0.0.1", "192.0.2.10", "2001:db8::7")
    ]
    for name in names:
        verifier = PolicyBuilder().store(authority).time(NOW).build_server_verifier(name)
        assert verifier.verify(router, [])
    stranger = PolicyBuilder().store(authority).time(NOW).build_server_verifier(x509.DNSName("other.example"))
    with pytest.raises(x509.verification.VerificationError):
        stranger.verify(router, [])


def test_the_authoritys_key_is_kept_nowhere(folder: Path) -> None:
    own = certificate(folder / "ca.pem").public_key()
    secrets = [each for each in folder.iterdir() if b"PRIVATE KEY" in each.read_bytes()]
    assert {each.name for each in secrets} == {f"{role}.key" for role in ROLES}
    assert all(load_pem_private_key(each.read_bytes(), None).public_key() != own for each in secrets)


def test_configurations_connect_to_the_first_host_and_the_router_listens_on_loopback(folder: Path) -> None:
    made = {role: json.loads(RoleKeys(folder, role).config.read_text()) for role in ROLES}
    router = made.pop(ROUTER)
    assert router["listen"] == {"endpoints": ["tls/127.0.0.1:7447"]}
    assert router["access_control"]["default_permission"] == "deny"
    for config in made.values():
        assert config["mode"] == "client"
        assert config["connect"] == {"endpoints": ["tls/lab.example:7447"]}
        assert config["listen"] == {"endpoints": []}
        assert not config["scouting"]["multicast"]["enabled"]
        assert config["transport"]["link"]["tls"]["verify_name_on_connect"]


def test_keys_are_not_replaced_unless_that_is_asked_for(tmp_path: Path) -> None:
    lab_keys(tmp_path / "keys")
    before = (tmp_path / "keys" / "ca.pem").read_bytes()
    with pytest.raises(UsageError, match=r"holds keys already; --force"):
        lab_keys(tmp_path / "keys")
    assert (tmp_path / "keys" / "ca.pem").read_bytes() == before
    make_keys(tmp_path / "keys", Deployment(TURTLEBOT3), now=NOW, replacing=True)
    assert (tmp_path / "keys" / "ca.pem").read_bytes() != before
    assert [each.name for each in tmp_path.iterdir()] == ["keys"]


def test_a_folder_with_something_else_in_it_is_left_alone_even_by_force(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(UsageError, match=r"thesis\.tex"):
        make_keys(tmp_path, Deployment(TURTLEBOT3), now=NOW, replacing=True)
    assert [each.name for each in tmp_path.iterdir()] == ["thesis.tex"]
    with pytest.raises(UsageError, match="is no folder"):
        lab_keys(tmp_path / "thesis.tex")


@pytest.mark.parametrize("host", ["192.0.2", "192.0.2.10:7447", "tls/lab", "", "lab .example", "-lab", "::g"])
def test_a_host_that_is_none_is_named_and_nothing_is_made(host: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="expected a name or an address"):
        make_keys(tmp_path / "keys", Deployment(TURTLEBOT3, hosts=(host,)), now=NOW)
    assert not list(tmp_path.iterdir())
