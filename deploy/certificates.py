"""The site's certificate authority and the certificates it issues: EC P-256, X.509."""

import ipaddress
import os
import secrets
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TypeAlias, cast

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from tagmap.errors import ConfigError

Key: TypeAlias = ec.EllipticCurvePrivateKey

AUTHORITY_DAYS = 3650
CLOCK_SKEW = timedelta(hours=1)
PEM = serialization.Encoding.PEM


@dataclass(frozen=True, slots=True)
class Authority:
    """Signs certificates; whoever holds its key is every participant."""

    certificate: x509.Certificate
    key: Key

    @property
    def pem(self) -> bytes:
        return self.certificate.public_bytes(PEM)


@dataclass(frozen=True, slots=True)
class Wanted:
    """What a participant's certificate must say. Only routers have `addresses`."""

    name: str
    addresses: tuple[str, ...] = ()


def open_authority(folder: Path, site: str) -> tuple[Authority, bool]:
    """The authority kept in `folder`, and whether it was made now."""
    name, key_path = f"tagmap {site}", folder / "ca.key"
    if key_path.exists() or (folder / "ca.crt").exists():
        authority = Authority(_read_certificate(folder / "ca.crt"), _read_key(key_path))
        found = common_name(authority.certificate)
        if found != name:
            raise ConfigError(f"{folder}: is the authority of {found!r}, expected {name!r}")
        if not _belongs(authority.certificate, authority.key):
            raise ConfigError(f"{folder}: ca.crt and ca.key do not belong together")
        return authority, False
    key = ec.generate_private_key(ec.SECP256R1())
    builder = _builder(name, name, key, AUTHORITY_DAYS)
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(_key_identifier(key), critical=False)
    builder = builder.add_extension(_usage(signs=True), critical=True)
    authority = Authority(builder.sign(key, hashes.SHA256()), key)
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_secret(key_path, key)
    write(folder / "ca.crt", authority.pem)
    return authority, True


def settle_certificate(
    folder: Path, authority: Authority, wanted: Wanted, valid_days: int, renew_days: int
) -> tuple[x509.Certificate, str]:
    """Make sure that `folder` holds a valid certificate with its key; say what was done.

    Renewing keeps key and common name, so that the rules stay true and only one file changes.
    """
    key_path, path = folder / "tls.key", folder / "tls.crt"
    if not (key_path.exists() and path.exists()):
        key, name = ec.generate_private_key(ec.SECP256R1()), f"{wanted.name}.{secrets.token_hex(4)}"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_secret(key_path, key)
        done = "issued"
    else:
        key, certificate = _read_key(key_path), _read_certificate(path)
        name = common_name(certificate)
        reason = _reason_to_renew(certificate, key, authority, wanted, renew_days)
        if reason is None:
            return certificate, "kept"
        done = f"renewed ({reason})"
    certificate = _issue(authority, key, name, wanted.addresses, valid_days)
    write(path, certificate.public_bytes(PEM))
    return certificate, done


def common_name(certificate: x509.Certificate) -> str:
    return str(certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value)


def write_secret(path: Path, key: Key) -> None:
    pem = key.private_bytes(PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    write(path, pem, mode=0o600)


def write(path: Path, content: bytes, mode: int = 0o644) -> bool:
    """Replace the file as a whole; False when it says so already."""
    if path.exists() and path.read_bytes() == content:
        return False
    fresh = path.with_name(path.name + ".new")
    fresh.unlink(missing_ok=True)
    with open(os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode), "wb") as file:
        file.write(content)
    fresh.replace(path)
    return True


def _issue(
    authority: Authority, key: Key, name: str, addresses: tuple[str, ...], valid_days: int
) -> x509.Certificate:
    builder = _builder(name, common_name(authority.certificate), key, valid_days)
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH]
    if addresses:
        uses.append(ExtendedKeyUsageOID.SERVER_AUTH)
        names = x509.SubjectAlternativeName([_general_name(address) for address in addresses])
        builder = builder.add_extension(names, critical=False)
    builder = builder.add_extension(x509.ExtendedKeyUsage(uses), critical=False)
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), True)
    builder = builder.add_extension(_usage(signs=False), critical=True)
    issuer = x509.AuthorityKeyIdentifier.from_issuer_public_key(authority.key.public_key())
    builder = builder.add_extension(issuer, critical=False)
    return builder.sign(authority.key, hashes.SHA256())


def _builder(name: str, issuer: str, key: Key, valid_days: int) -> x509.CertificateBuilder:
    now = datetime.now(UTC)
    return x509.CertificateBuilder(
        issuer_name=_distinguished(issuer),
        subject_name=_distinguished(name),
        public_key=key.public_key(),
        serial_number=x509.random_serial_number(),
        not_valid_before=now - CLOCK_SKEW,
        not_valid_after=now + timedelta(days=valid_days),
    )


def _reason_to_renew(
    certificate: x509.Certificate, key: Key, authority: Authority, wanted: Wanted, renew_days: int
) -> str | None:
    left = certificate.not_valid_after_utc - datetime.now(UTC)
    if left < timedelta(days=renew_days):
        return f"{max(left.days, 0)} days were left"
    if not _belongs(certificate, key):
        return "it was of another key"
    try:
        certificate.verify_directly_issued_by(authority.certificate)
    except (ValueError, InvalidSignature):
        return "it was of another authority"
    if _addresses(certificate) != {_general_name(address) for address in wanted.addresses}:
        return "addresses changed"
    return None


def _addresses(certificate: x509.Certificate) -> set[x509.GeneralName]:
    try:
        found = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName)
    except x509.ExtensionNotFound:
        return set()
    return set(found.value)


def _general_name(address: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(address))
    except ValueError:
        return x509.DNSName(address)


def _belongs(certificate: x509.Certificate, key: Key) -> bool:
    return certificate.public_key() == key.public_key()


def _key_identifier(key: Key) -> x509.SubjectKeyIdentifier:
    return x509.SubjectKeyIdentifier.from_public_key(key.public_key())


def _distinguished(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


def _usage(signs: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not signs,
        key_cert_sign=signs,
        crl_sign=signs,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _read_certificate(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except ValueError:
        raise ConfigError(f"{path}: not a PEM certificate") from None


def _read_key(path: Path) -> Key:
    try:
        return cast(Key, serialization.load_pem_private_key(path.read_bytes(), password=None))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror}") from None
    except (ValueError, TypeError):
        raise ConfigError(f"{path}: not an unencrypted PEM private key") from None
