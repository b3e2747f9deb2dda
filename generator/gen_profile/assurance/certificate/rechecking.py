"""What the re-checker covers: said here, too, since it shares nothing with this program."""

from pathlib import PurePath

from gen_profile.plants.registry import is_built_in
from gen_profile.spec.model import Spec
from gen_profile_exporters.registry import format_of


def not_covered(path: PurePath, spec: Spec) -> tuple[str, ...]:
    """Name what of a file and its spec has no equations, or no reader, in `gen_profile_recheck`."""
    export, plant = spec.export, spec.plant
    table = export.csv_dialect == "rfc4180" and "position" in export.csv_columns
    covered = {
        f"machines of type {plant.type}": plant.file is None and is_built_in(plant.type),
        "the clearance of a path": spec.path is None,
        "drives that lag behind their setpoints": spec.actuator.tau is None,
        f"such {format_of(path)} files": {"plc": True, "csv": table}.get(format_of(path), False),
    }
    return tuple(name for name, it_is in covered.items() if not it_is)
