"""Application certificates of OPC UA: a PEM file of a certificate and its key, made where it is not there."""

import hashlib
import os
import re
import socket
from datetime import UTC, datetime
from pathlib import Path

import attrs
from asyncua.crypto import cert_gen
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.x509.oid import ExtendedKeyUsageOID

from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.errors import DeploymentError, OutputError

YEARS = 5  # that a certificate is good for
MOST_BYTES = 1 << 16  # bytes of such a file
_PARTS = re.compile(rb"-----BEGIN ([A-Z ]+)-----.*?-----END \1-----\n?", re.DOTALL)


@attrs.frozen(kw_only=True)
class ApplicationCertificate:
    """Who a program is: its certificate, the key of it in PEM, and the URI that the certificate names."""

    certificate: x509.Certificate
    key: bytes
    uri: str

    @property
    def der(self) -> bytes:
        """The certificate as it is sent."""
        return self.certificate.public_bytes(serialization.Encoding.DER)


def fingerprint(der: bytes) -> str:
    """Hash a certificate as controllers show it: SHA-256."""
    return hashlib.sha256(der).hexdigest()


def require_current(certificate: x509.Certificate, whose: str) -> None:
    """Refuse a certificate out of its time.

    Raises
    ------
    DeploymentError
    """
    begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    if not begin <= datetime.now(UTC) <= end:
        raise DeploymentError(
            f"{whose} is good from {begin:%Y-%m-%d} to {end:%Y-%m-%d} only; renew it, or set the clock."
        )


def own_certificate(path: Path) -> ApplicationCertificate:
    """Read a file with a certificate and its key; make one where there is none.

    Raises
    ------
    OutputError
        It cannot be read or written, or holds something else.
    DeploymentError
        The certificate is out of its time.
    """
    if not path.exists():
        _write_private(path, _made())
    parts = {found[1]: found[0] for found in _PARTS.finditer(read_artefact(path, MOST_BYTES))}
    try:
        certificate = x509.load_pem_x509_certificate(parts[b"CERTIFICATE"])
        (key,) = (part for name, part in parts.items() if name.endswith(b"PRIVATE KEY"))
        serialization.load_pem_private_key(key, password=None)
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        uri = names.get_values_for_type(x509.UniformResourceIdentifier)[0]
    except (KeyError, ValueError, TypeError, IndexError, x509.ExtensionNotFound) as error:
        raise OutputError(
            f"certificate {path}: is no PEM file of a certificate that names an application URI, and of its "
            "key without a password; name a file that is not there, and one is made."
        ) from error
    require_current(certificate, f"The certificate in {path}")
    return ApplicationCertificate(certificate=certificate, key=key, uri=uri)


def _made() -> bytes:
    """Make a certificate that an application signs itself (OPC 10000-6, 6.2.2)."""
    host, key = socket.gethostname(), cert_gen.generate_private_key()
    names = [x509.UniformResourceIdentifier(f"urn:{host}:gen-profile"), x509.DNSName(host)]
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    made: x509.Certificate = cert_gen.generate_self_signed_app_certificate(
        key, "gen-profile", {}, names, uses, days=365 * YEARS
    )
    return made.public_bytes(serialization.Encoding.PEM) + bytes(cert_gen.dump_private_key_as_pem(key))


def _write_private(path: Path, content: bytes) -> None:
    """Write a file that no other user may read."""
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(content)
    except OSError as error:
        raise OutputError(f"certificate {path}: cannot be written ({error.strerror}).") from error
