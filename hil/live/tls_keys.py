"""Keys of a lab: an authority that is forgotten once it has signed, and a certificate for each role."""

from __future__ import annotations

import datetime
import ipaddress
import os
import re
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from hil.errors import UsageError
from hil.scenario.schema import Scenario
from hil.wire.access import access_control, keys_said
from hil.wire.role_keys import AUTHORITY, RoleKeys
from hil.wire.roles import ROLES, ROUTER, Role
from hil.wire.session_config import role_text

LOOPBACK = ("localhost", "127.0.0.1", "::1")
_PORT = 7447
_LABEL = r"[A-Za-z0-9]([A-Za-z0-9-]*[A-Za-z0-9])?"
_HOST = re.compile(rf"(?=.{{1,253}}$){_LABEL}(\.{_LABEL})*")
_CLOCKS_DIFFER = datetime.timedelta(days=1)
_USAGE = {
    "digital_signature": False, "content_commitment": False, "key_encipherment": False,
    "data_encipherment": False, "key_agreement": False, "key_cert_sign": False, "crl_sign": False,
    "encipher_only": False, "decipher_only": False,
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Deployment:
    """What keys are made for: a scenario's names, where its router is reached, and for how long.

    ``hosts``: names and addresses besides those of loopback.
    """

    scenario: Scenario
    hosts: tuple[str, ...] = ()
    days: int = 825


def make_keys(folder: Path, wanted: Deployment, *, now: datetime.datetime, replacing: bool = False) -> None:
    """Make a folder with the authority's certificate and, for each role, certificate, key and Zenoh config.

    ``now``: in UTC; a day before it they are valid already, as clocks of robots may be wrong. What another
    folder of that name held is gone with ``replacing``, and nobody gets in by it any more. Raises
    :class:`UsageError` for a folder that is there already, or holds something else than keys, and for hosts
    that are neither name nor address.
    """
    names = [_host(each) for each in dict.fromkeys((*LOOPBACK, *wanted.hosts))]
    _refuse_taken(folder, replacing=replacing)
    folder.parent.mkdir(parents=True, exist_ok=True)
    making = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        _fill(making, folder, wanted, _Authority(now, wanted.days), names)
        if folder.exists():
            shutil.rmtree(folder)
        making.rename(folder)
    except BaseException:
        shutil.rmtree(making, ignore_errors=True)
        raise


class _Authority:
    """Signs certificates; its key is never written, so that nobody can sign another one."""

    def __init__(self, now: datetime.datetime, days: int) -> None:
        self._key = ec.generate_private_key(ec.SECP256R1())
        self._since, self._until = now - _CLOCKS_DIFFER, now + datetime.timedelta(days=days)
        self._name = _named("abreast authority")
        usage = x509.KeyUsage(**(_USAGE | {"key_cert_sign": True, "crl_sign": True}))
        self.certificate = (
            self._begun(self._name, self._key.public_key())
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(usage, critical=True)
            .sign(self._key, hashes.SHA256())
        )

    def sign(
        self, role: Role, key: ec.EllipticCurvePublicKey, names: Sequence[x509.GeneralName]
    ) -> x509.Certificate:
        """Certificate of a role. Only the router's is that of a server: no other may pass for it."""
        purpose = ExtendedKeyUsageOID.SERVER_AUTH if role == ROUTER else ExtendedKeyUsageOID.CLIENT_AUTH
        usage = x509.KeyUsage(**(_USAGE | {"digital_signature": True}))
        whom = x509.AuthorityKeyIdentifier.from_issuer_public_key(self._key.public_key())
        return (
            self._begun(_named(role), key)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(usage, critical=True)
            .add_extension(x509.ExtendedKeyUsage([purpose]), critical=False)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .add_extension(whom, critical=False)
            .sign(self._key, hashes.SHA256())
        )

    def _begun(self, name: x509.Name, key: ec.EllipticCurvePublicKey) -> x509.CertificateBuilder:
        return (
            x509.CertificateBuilder()
            .subject_name(name)
            .issuer_name(self._name)
            .public_key(key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(self._since)
            .not_valid_after(self._until)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
        )


def _fill(
    making: Path,
    folder: Path,
    wanted: Deployment,
    authority: _Authority,
    names: Sequence[x509.GeneralName],
) -> None:
    """Write all files to a folder that is to have another name."""
    _write(making / AUTHORITY, _pem(authority.certificate))
    server = f"[{host}]" if ":" in (host := (*wanted.hosts, "127.0.0.1")[0]) else host
    for role in ROLES:
        here, there = RoleKeys(making, role), RoleKeys(folder, role)
        key = ec.generate_private_key(ec.SECP256R1())
        own = names if role == ROUTER else [x509.DNSName(role)]
        _write(here.certificate, _pem(authority.sign(role, key.public_key(), own)))
        secret = key.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.NoEncryption(),
        )
        _write(here.secret, secret)
        access = access_control(wanted.scenario) if role == ROUTER else None
        place = "127.0.0.1" if role == ROUTER else server
        says = keys_said(wanted.scenario, role)
        _write(here.config, role_text(there, f"tls/{place}:{_PORT}", says, access).encode())


def _refuse_taken(folder: Path, *, replacing: bool) -> None:
    if not folder.exists():
        return
    if not folder.is_dir():
        raise UsageError(f"{folder}: is no folder; give another one")
    there = sorted(each.name for each in folder.iterdir())
    known = {AUTHORITY, *(f"{role}{end}" for role in ROLES for end in (".pem", ".key", ".json5"))}
    if strange := [name for name in there if name not in known]:
        raise UsageError(f"{folder}: holds {strange[0]}, which is no key of ours; give an empty folder")
    if there and not replacing:
        raise UsageError(
            f"{folder}: holds keys already; --force makes all anew, and nobody gets in by the old ones then"
        )


def _host(given: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(given))
    except ValueError:
        pass
    # A port, a protocol or an address with a slip in it.
    if not _HOST.fullmatch(given) or given.replace(".", "").isdigit():
        raise UsageError(
            f"--host {given!r}: expected a name or an address without a port, such as lab or 192.0.2.10"
        )
    return x509.DNSName(given)


def _named(common_name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, common_name)])


def _pem(certificate: x509.Certificate) -> bytes:
    return certificate.public_bytes(serialization.Encoding.PEM)


def _write(path: Path, content: bytes) -> None:
    """Write a file that nobody else can read, not even before it is whole."""
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(content)
