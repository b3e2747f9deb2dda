"""Compile all Python code of a folder into an archive and remove it; run by the Python that is to import it.

That of other projects is compiled without docstrings, as by `python -OO`.
"""

import py_compile
import sys
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile


def main(folder: Path, archive: Path) -> None:
    """Do so."""
    with ZipFile(archive, "w", ZIP_DEFLATED, compresslevel=9) as packed:
        for path in sorted(folder.rglob("*.py")):
            name, compiled = path.relative_to(folder), path.with_suffix(".pyc")
            level = 0 if name.parts[0].startswith("gen_profile") else 2
            py_compile.compile(
                str(path),
                str(compiled),
                dfile=name.as_posix(),
                doraise=True,
                optimize=level,
                invalidation_mode=py_compile.PycInvalidationMode.UNCHECKED_HASH,
            )
            packed.write(compiled, compiled.relative_to(folder).as_posix())
            compiled.unlink()
            path.unlink()


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
