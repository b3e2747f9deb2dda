"""Options that sign manifests, and ask for signed ones.

The key is named by the user alone: a spec may be a stranger's.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gen_profile.cli.options import InputFile, option
from gen_profile.support.plugins import require_installed

if TYPE_CHECKING:
    from collections.abc import Callable

    from gen_profile.support.artefacts.signature import Key

signed_by_option = option(
    "--signed-by", "Refuse what this public key has not signed.", InputFile(), into="public_path"
)


def signing_option(what: str) -> Callable[[Any], Any]:
    """Take the key that signs a manifest, or something else."""
    words = f"Sign the {what} with this secret key, made by minisign -GW."
    return option("--sign", words, InputFile(), into="key_path")


def signing_key(path: Path | None) -> Key | None:
    """Read the key before there is any work to lose."""
    if path is None:
        return None
    require_installed("Signatures need the package cryptography", "sign", "cryptography")
    from gen_profile.support.artefacts.signature import secret_key

    return secret_key(path)


def sign(folder: Path, key: Key | None) -> None:
    """Sign what was delivered, and say so."""
    if key is not None:
        from gen_profile.support.artefacts.signature import sign_manifest

        click.echo(f"Signed by {key.identity}: {sign_manifest(folder, key)}", err=True)


def require_signature(artefact: Path, public_path: Path | None) -> None:
    """Refuse an artefact that no manifest covers which the key has signed."""
    if public_path is not None:
        require_installed("Signatures need the package cryptography", "sign", "cryptography")
        from gen_profile.support.artefacts.signature import public_key, require_signed

        key = public_key(public_path)
        require_signed(artefact, key)
        click.echo(f"Signed by {key.identity}.", err=True)
