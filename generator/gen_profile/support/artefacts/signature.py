"""Signatures of manifests, for files that pass through other hands: those of minisign (F. Denis).

A key file holds a comment and a line in Base64: what the algorithm is, the key's number, the key. A
signature is of the file's BLAKE2b hash; a second one is of the first and of the trusted comment, which
`minisign` shows. Whatever this writes `minisign` verifies, and the other way round. A manifest holds the
spec, its machine's hash, and the hash of every file, so that a signed one covers all of them.
"""

import base64
import hashlib
from binascii import Error as NotBase64
from pathlib import Path

import attrs
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey, Ed25519PublicKey

from gen_profile.support.artefacts.manifest import FILENAME, parse_manifest, sha256
from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.artefacts.writing import deliver
from gen_profile.support.bounded_file import DOCUMENT
from gen_profile.support.errors import CheckFailed, OutputError

SIGNATURE = f"{FILENAME}.minisig"
PURE, PREHASHED = b"Ed", b"ED"  # Ed25519 of a file, and of its hash
UNENCRYPTED = b"\0\0"  # of what would derive a key from a password
NUMBER = 8  # bytes of a key's number
SECRET_AT = 54  # bytes of a secret key's file before its number: algorithms, salt, limits of scrypt
MOST_BYTES = 1 << 20  # bytes of a key or signature, by far


@attrs.frozen(kw_only=True)
class Key:
    """A key and its number.

    Attributes
    ----------
    number : bytes
    content : bytes
        Ed25519's 32 bytes: the public key, or the seed of the secret one.
    """

    number: bytes
    content: bytes

    @property
    def identity(self) -> str:
        """The number as `minisign` writes it."""
        return self.number[::-1].hex().upper()


def secret_key(path: Path) -> Key:
    """Read a secret key, as ``minisign -GW`` makes it.

    Raises
    ------
    OutputError
        It is none, or is encrypted.
    """
    content = _decoded(path, _lines(path)[1:2], "secret key")
    if content[:2] != PURE or len(content) != SECRET_AT + NUMBER + 64 + 32:
        raise OutputError(f"sign {path}: is no secret key of minisign.")
    if content[2:4] != UNENCRYPTED:
        raise OutputError(
            f"sign {path}: the key is encrypted; let minisign itself sign: minisign -Sm {FILENAME}"
        )
    return Key(number=content[SECRET_AT:][:NUMBER], content=content[SECRET_AT + NUMBER :][:32])


def public_key(path: Path) -> Key:
    """Read a public key.

    Raises
    ------
    OutputError
        It is none.
    """
    content = _decoded(path, _lines(path)[1:2], "public key")
    if content[:2] != PURE or len(content) != 2 + NUMBER + 32:
        raise OutputError(f"signed_by {path}: is no public key of minisign.")
    return Key(number=content[2:][:NUMBER], content=content[2 + NUMBER :])


def sign_manifest(folder: Path, key: Key) -> Path:
    """Write the signature of a folder's manifest beside it, and give its path."""
    path = folder / FILENAME
    name = parse_manifest(read_artefact(path, DOCUMENT), FILENAME).name
    return sign_file(path, f"manifest of {name}", key)


def sign_file(path: Path, comment: str, key: Key) -> Path:
    """Write a file's signature beside it, with a trusted comment, and give its path."""
    content, secret = read_artefact(path, DOCUMENT), Ed25519PrivateKey.from_private_bytes(key.content)
    signature = secret.sign(_hash(content))
    lines = (
        f"untrusted comment: signature by gen-profile, key {key.identity}",
        base64.b64encode(PREHASHED + key.number + signature).decode(),
        f"trusted comment: {comment}",
        base64.b64encode(secret.sign(signature + comment.encode())).decode(),
    )
    beside = path.with_name(f"{path.name}.minisig")
    deliver(beside, ("\n".join(lines) + "\n").encode())
    return beside


def require_signed(artefact: Path, key: Key) -> None:
    """Refuse a file whose manifest a key has not signed, or does not list; nothing of it is run for that.

    Raises
    ------
    CheckFailed
        Nothing covers the file.
    OutputError
        The manifest or the signature cannot be read.
    """
    manifest, path = artefact.parent / FILENAME, artefact.parent / SIGNATURE
    content, lines = read_artefact(manifest, DOCUMENT), _lines(path)
    packed, trusted = (_decoded(path, lines[at : at + 1], "signature") for at in (1, 3))
    kind, number, signature = packed[:2], packed[2:][:NUMBER], packed[2 + NUMBER :]
    comment = lines[2].removeprefix("trusted comment: ")
    if number != key.number:
        raise CheckFailed(f"{path} is by another key ({number[::-1].hex().upper()}) than {key.identity}.")
    public = Ed25519PublicKey.from_public_bytes(key.content)
    try:
        public.verify(signature, content if kind == PURE else _hash(content))
        public.verify(trusted, signature + comment.encode())
    except InvalidSignature:
        raise CheckFailed(f"{path} does not fit {manifest}: it was altered after it was signed.") from None
    signed = parse_manifest(content, str(manifest))
    listed = {known.sha256 for one in (signed, *signed.earlier) for known in one.artefacts}
    if sha256(read_artefact(artefact)) not in listed:
        raise CheckFailed(f"{artefact} is none of the files that the signed {FILENAME} lists.")


def _hash(content: bytes) -> bytes:
    return hashlib.blake2b(content).digest()


def _lines(path: Path) -> list[str]:
    return read_artefact(path, MOST_BYTES).decode("utf-8", "replace").splitlines()


def _decoded(path: Path, lines: list[str], what: str) -> bytes:
    try:
        (line,) = lines
        return base64.b64decode(line, validate=True)
    except (NotBase64, ValueError) as error:
        raise OutputError(f"{path}: is no {what} of minisign.") from error
