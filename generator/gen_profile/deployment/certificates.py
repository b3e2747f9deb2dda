"""Application certificates of OPC UA: one PEM file with a certificate and its key, made where there is none."""

from __future__ import annotations

import hashlib
import os
import re
import socket
from datetime import UTC, datetime, timedelta
from pathlib import Path

import attrs
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from gen_profile.artefacts.reading import read_artefact
from gen_profile.errors import DeploymentError, OutputError

YEARS, BITS = 5, 2048
MOST = 1 << 16  # bytes of such a file
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
            f"{whose} is valid from {begin:%Y-%m-%d} to {end:%Y-%m-%d} only; renew it, or set the clock right."
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
    parts = {found[1]: found[0] for found in _PARTS.finditer(read_artefact(path, MOST))}
    try:
        certificate = x509.load_pem_x509_certificate(parts[b"CERTIFICATE"])
        (key,) = (part for name, part in parts.items() if name.endswith(b"PRIVATE KEY"))
        serialization.load_pem_private_key(key, password=None)
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        uri = names.get_values_for_type(x509.UniformResourceIdentifier)[0]
    except (KeyError, ValueError, TypeError, IndexError, x509.ExtensionNotFound) as error:
        raise OutputError(
            f"certificate {path}: is no PEM file with a certificate that names an application URI, and its key "
            "without a password; name a file that is not there, and one is made."
        ) from error
    require_current(certificate, f"The certificate in {path}")
    return ApplicationCertificate(certificate=certificate, key=key, uri=uri)


def _made() -> bytes:
    """Make a certificate that an application signs itself (OPC 10000-6, 6.2.2)."""
    host = socket.gethostname()
    key = rsa.generate_private_key(public_exponent=65537, key_size=BITS)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "gen-profile")])
    now, identifier = datetime.now(UTC), x509.SubjectKeyIdentifier.from_public_key(key.public_key())
    usage = dict.fromkeys(
        ("digital_signature", "content_commitment", "key_encipherment", "data_encipherment", "key_cert_sign"),
        True,
    )
    usage |= dict.fromkeys(("key_agreement", "crl_sign", "encipher_only", "decipher_only"), False)
    uses = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    uri, dns = x509.UniformResourceIdentifier(f"urn:{host}:gen-profile"), x509.DNSName(host)
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(hours=1))
        .not_valid_after(now + timedelta(days=365 * YEARS))
        .add_extension(x509.SubjectAlternativeName([uri, dns]), critical=False)
        .add_extension(identifier, critical=False)
        .add_extension(x509.AuthorityKeyIdentifier(identifier.digest, None, None), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(x509.KeyUsage(**usage), critical=True)
        .add_extension(x509.ExtendedKeyUsage(uses), critical=False)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return certificate.public_bytes(serialization.Encoding.PEM) + secret


def _write_private(path: Path, content: bytes) -> None:
    """Write a file that nobody else may read."""
    try:
        with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
            file.write(content)
    except OSError as error:
        raise OutputError(f"certificate {path}: cannot be written ({error.strerror}).") from error
