"""``deployments.json`` beside the manifest: what was put into which controllers, by whom and when."""

import json
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from gen_profile.support.artefacts.reading import read_artefact
from gen_profile.support.artefacts.writing import deliver
from gen_profile.support.bounded_file import DOCUMENT
from gen_profile.support.errors import OutputError
from gen_profile.support.strict_json import parse_document

RECORD = "deployments.json"
HEAD = {"format": "gen-profile deployments", "format_version": 1}


def read_record(folder: Path) -> list[dict[str, Any]]:
    """List the deployments that a folder's record holds, the latest last.

    Raises
    ------
    OutputError
        The record is none.
    """
    path = folder / RECORD
    if not path.is_file():
        return []
    try:
        document = parse_document(read_artefact(path, DOCUMENT).decode("utf-8"), HEAD)
        return [dict(one) for one in document["deployments"]]
    except (ValueError, KeyError, TypeError) as error:
        raise OutputError(f"{path}: is no record of deployments; move it away.") from error


def append_record(
    folder: Path, done: Mapping[str, Any], server: Mapping[str, str], by: str
) -> dict[str, Any]:
    """Write a deployment behind those that are recorded already, and give its entry."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    entry = {"at": now, "by": by, "controller": dict(server), **done}
    document = {**HEAD, "deployments": [*read_record(folder), entry]}
    deliver(folder / RECORD, (json.dumps(document, indent=2, ensure_ascii=False) + "\n").encode("utf-8"))
    return entry


def recorded(folder: Path, table_sha256: str, server: Mapping[str, str]) -> dict[str, Any] | None:
    """Find the latest deployment of a table to an instance."""
    fitting = (
        one
        for one in reversed(read_record(folder))
        if one.get("table_sha256") == table_sha256
        and all(one.get("controller", {}).get(key) == server[key] for key in ("url", "instance"))
    )
    return next(fitting, None)
