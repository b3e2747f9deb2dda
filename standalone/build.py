"""A folder with gen-profile, Python and a C compiler inside, for engineers who have no Python.

`python standalone/build.py FOLDER` copies the Python that runs it, with the libraries that it needs beyond
glibc. With `--windows EMBEDDABLE` the folder is for Windows, around python.org's embeddable package. Nothing
is frozen: what works where gen-profile is installed with pip works in the folder.
"""

from __future__ import annotations

import argparse
import lzma
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
from collections.abc import Iterator, Sequence
from fnmatch import fnmatch
from importlib.metadata import distributions
from pathlib import Path, PurePosixPath

HERE = Path(__file__).resolve().parent
CONTENTS = tomllib.loads((HERE / "contents.toml").read_text("utf-8"))
# glibc's, which a program must take from the computer it runs on
OF_THE_SYSTEM = re.compile(r"(ld-linux.*|lib(anl|c|crypt|dl|m|nsl|pthread|resolv|rt|util))\.so.*")
START = "from gen_profile.cli import main; main()"
ON_LINUX = f"""\
#!/bin/sh
here=$(PATH=/usr/bin:/bin readlink -f -- "$0" || echo "$0")
exec "${{here%/*}}/python/bin/python3" -c '{START}' "$@"
"""
ON_WINDOWS = f'@"%~dp0python\\python.exe" -c "{START}" %*\r\n'


def main() -> None:
    """Build."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--windows", type=Path, metavar="EMBEDDABLE")
    arguments = parser.parse_args()
    folder, embeddable = arguments.folder.resolve(), arguments.windows
    packages, licences = folder / "packages", folder / "licences"
    shutil.rmtree(folder, ignore_errors=True)
    licences.mkdir(parents=True)
    if embeddable:
        version = _copy_embeddable(embeddable, folder / "python")
        _install(packages, "--python-platform=x86_64-pc-windows-msvc", f"--python-version={version}")
    else:
        _copy_python(folder / "python")
        _install(packages)
    shutil.copy(next(folder.glob("python/**/LICENSE.txt")), licences / "python.txt")
    _leave_out(packages)
    if not embeddable:
        _bring_libraries(folder / "python", [*_binaries(folder)], licences)
        _link_twins(packages)
    _write_licences(folder)
    _pack_compiler(packages / "ziglang", licences / "zig")
    own = ("wine64", folder / "python" / "python.exe") if embeddable and sys.platform != "win32" else ()
    _pack_code(folder, own or (sys.executable,))
    launcher = folder / ("gen-profile.cmd" if embeddable else "gen-profile")
    launcher.write_text(ON_WINDOWS if embeddable else ON_LINUX, "utf-8", newline="")
    launcher.chmod(0o755)


def _run(*command: str | Path) -> str:
    return subprocess.run(
        command, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True
    ).stdout


def _remove(path: Path) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)


def _copy_python(folder: Path) -> None:
    """Copy the Python that runs this; it looks only into the folder, whatever the environment says."""
    standard = f"python{sysconfig.get_python_version()}"
    (folder / "bin").mkdir(parents=True)
    shutil.copy(Path(sys._base_executable).resolve(), folder / "bin" / "python3")  # type: ignore[attr-defined]
    ignored = shutil.ignore_patterns(*CONTENTS["standard_library"])
    shutil.copytree(sysconfig.get_path("stdlib"), folder / "lib" / standard, ignore=ignored)
    paths = f"../lib/{standard}.zip", f"../lib/{standard}/lib-dynload", "../../packages", "import site"
    (folder / "bin" / "python3._pth").write_text("\n".join(paths) + "\n", "utf-8")


def _copy_embeddable(embeddable: Path, folder: Path) -> str:
    """Unpack python.org's package for Windows; its version."""
    shutil.unpack_archive(embeddable, folder, "zip")
    (paths,) = folder.glob("python3*._pth")
    paths.write_text(f"{paths.stem}.zip\n.\n..\\packages\nimport site\n", "utf-8")
    return paths.stem.removeprefix("python").replace("3", "3.", 1)


def _install(packages: Path, *options: str) -> None:
    install = (sys.executable, "-m", "uv", "pip", "install", "--quiet", "--link-mode=copy")
    wheels = ("--only-binary=:all:", "--no-binary=gen-profile")
    place = (f"--python={sys.executable}", f"--target={packages}", *options)
    _run(*install, *wheels, *place, f"{HERE.parent}[{CONTENTS['extras']}]")


def _leave_out(packages: Path) -> None:
    """Remove what `contents.toml` names."""
    for name in CONTENTS["distributions"]:
        for distribution in distributions(name=name, path=[str(packages)]):
            for top in {path.parts[0] for path in distribution.files or ()} - {".."}:
                _remove(packages / top)
    for path in [path for pattern in CONTENTS["top"] for path in packages.glob(pattern)]:
        _remove(path)
    for path in [*packages.rglob("*")]:
        package, *inner = path.relative_to(packages).parts
        if inner and path.is_file() and not _is_needed(package, PurePosixPath(*inner)):
            path.unlink()
    for path in sorted(packages.rglob("*"), reverse=True):
        if path.is_dir() and not any(path.iterdir()):
            path.rmdir()


def _is_needed(package: str, path: PurePosixPath) -> bool:
    def matches(patterns: Sequence[str]) -> bool:
        return any(fnmatch(str(part), pattern) for part in (path, *path.parents) for pattern in patterns)

    if package in CONTENTS["only"]:
        return matches(CONTENTS["only"][package])
    if package.startswith("gen_profile"):
        return True  # lazy_loader reads names from a .pyi
    everywhere = any(fnmatch(part, pattern) for part in path.parts for pattern in CONTENTS["everywhere"])
    return not everywhere and not matches(CONTENTS["packages"].get(package, ()))


def _binaries(folder: Path) -> Iterator[Path]:
    """Find programs and libraries, Zig aside, which is whole in itself."""
    for path in folder.rglob("*"):
        if path.is_file() and path.name != "zig" and (".so" in path.name or path.parent.name == "bin"):
            with path.open("rb") as file:
                if file.read(4) == b"\x7fELF":
                    yield path


def _bring_libraries(python: Path, binaries: list[Path], licences: Path) -> None:
    """Copy the computer's libraries that a folder's need, have them found, and strip all of them."""
    for binary in binaries:
        for name, path in re.findall(r"(\S+) => (/\S+)", _run("ldd", binary)):
            if python.parent not in Path(path).parents and not OF_THE_SYSTEM.fullmatch(name):
                shutil.copy(path, python / "lib" / name)
                if not name.startswith("libpython") and shutil.which("dpkg"):
                    package = _run("dpkg", "-S", f"*/{name}").partition(":")[0]
                    shutil.copy(f"/usr/share/doc/{package}/copyright", licences / f"{name}.txt")
    brought = [*_binaries(python)]
    # it breaks what auditwheel has put into folders *.libs
    _run("strip", "--strip-unneeded", *brought, *(path for path in binaries if path.parent.suffix != ".libs"))
    for path in brought:
        place = os.path.relpath(python / "lib", path.parent)
        _run("patchelf", "--force-rpath", "--set-rpath", f"$ORIGIN/{place}", path)
    # its libraries' own search paths need not lead there
    _run("patchelf", "--add-needed", "libstdc++.so.6", python / "bin" / "python3")
    for path in binaries:
        for name in _run("patchelf", "--print-needed", path).split():
            if any(fnmatch(name, pattern) for pattern in CONTENTS["not_linked"]):
                _run("patchelf", "--remove-needed", name, path)


def _link_twins(packages: Path) -> None:
    """Keep a library that several packages bring once."""
    first: dict[str, Path] = {}
    for path in sorted(packages.glob("*.libs/*")):
        twin = first.setdefault(path.name, path)
        if twin != path and twin.read_bytes() == path.read_bytes():
            path.unlink()
            path.symlink_to(os.path.relpath(twin, path.parent))


def _write_licences(folder: Path) -> None:
    """List the packages, and where all licences are."""
    rows = {}
    for found in distributions(path=[str(folder / "packages")]):
        told = [
            classifier
            for classifier in found.metadata.get_all("Classifier", ())
            if "License ::" in classifier
        ]
        words = found.metadata["License-Expression"] or found.metadata["License"] or ", ".join(told)
        licence = words.partition("\n")[0].removeprefix("License :: OSI Approved :: ")
        rows[found.name.lower()] = f"| {found.name} | {found.version} | {licence} |\n"
    table = "".join(rows[name] for name in sorted(rows))
    (folder / "LICENCES.md").write_text((HERE / "licences.md").read_text("utf-8") + table, "utf-8")


def _pack_compiler(ziglang: Path, licences: Path) -> None:
    """Pack Zig, half of everything otherwise; gen-profile unpacks it into its cache to compile."""
    licences.mkdir()
    for text in [*ziglang.rglob("LICENSE*"), *ziglang.rglob("COPYING*")]:
        shutil.copy(text, licences / "-".join(text.relative_to(ziglang).parts))
    filters = [{"id": lzma.FILTER_X86}, {"id": lzma.FILTER_LZMA2, "preset": 6}]
    with (
        lzma.open(ziglang / "zig.tar.xz", "wb", filters=filters) as packed,
        tarfile.open(fileobj=packed, mode="w") as archive,
    ):
        for name in ("zig", "zig.exe", "lib"):
            if (ziglang / name).exists():
                archive.add(ziglang / name, name)
                _remove(ziglang / name)


def _pack_code(folder: Path, python: Sequence[str | Path]) -> None:
    """Have a Python of the folder's version compile and pack all code: a third of its size, and as quick."""
    for library in folder.glob("python/lib/python3*"):
        _run(*python, HERE / "pack_code.py", library, library.with_name(f"{library.name}.zip"))
    _run(*python, HERE / "pack_code.py", folder / "packages", folder / "packages" / "code.zip")
    shutil.copy(HERE / "sitecustomize.py", folder / "packages")


if __name__ == "__main__":
    main()
