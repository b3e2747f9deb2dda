"""Where FMUs are kept, and that whatever happens to the cache, a good FMU comes out."""

import os
import subprocess
import sys
from pathlib import Path

import attrs
import pytest
from fmu.caches import share_zig

from gen_profile.support.errors import CosimulationError
from gen_profile.support.private_folder import cache_folders
from gen_profile_fmu.building import build
from gen_profile_fmu.building.cache import cached, is_intact, write_entry
from gen_profile_fmu.building.plant_fmu import plant_fmu
from gen_profile_fmu.running.cosimulation import PlantCosimulation

BUILD = """
from gen_profile.plants.registry import find_plant
from gen_profile_fmu.building.plant_fmu import plant_fmu
print(plant_fmu(find_plant("double-pendulum-crane")).archive)
"""


@pytest.fixture
def builds(crane):
    """Get the crane's FMU and count the compilations."""

    class Builds:
        count = 0

        def get(self):
            def progress(_):
                self.count += 1

            return plant_fmu(crane, progress)

    return Builds()


@pytest.fixture
def new_cache(tmp_path, cache, monkeypatch):
    """An empty cache, but for what Zig has built of the C library."""
    folder = tmp_path / "new"
    share_zig(cache, folder)
    monkeypatch.setenv("GEN_PROFILE_CACHE", str(folder))
    return folder


@pytest.fixture(scope="module")
def libraries():
    """What was compiled, by all that it is made of."""
    return {}


@pytest.fixture
def compiled_once(libraries, monkeypatch):
    """Spare tests of what becomes of a library its second compilation."""
    compile_library = build.compile_library

    def compile_or_copy(compiler, folder, source, output, zig_cache):
        texts = tuple((path.name, path.read_bytes()) for path in sorted(folder.iterdir()))
        key = (compiler, texts, source, output)
        if key not in libraries:
            compile_library(compiler, folder, source, output, zig_cache)
            libraries[key] = (folder / output).read_bytes()
        (folder / output).write_bytes(libraries[key])

    monkeypatch.setattr(build, "compile_library", compile_or_copy)


@pytest.fixture
def temporary_folder(tmp_path, monkeypatch):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def works(crane):
    with PlantCosimulation(crane):
        return True


class TestPlantFmu:
    @pytest.mark.slow
    def test_is_compiled_once(self, new_cache, builds):
        first = builds.get()
        assert (builds.count, builds.get(), builds.count) == (1, first, 1)
        assert first.archive.is_relative_to(new_cache)
        assert first.archive.is_file()

    @pytest.mark.slow
    @pytest.mark.usefixtures("compiled_once")
    def test_is_compiled_again_for_other_equations(self, new_cache, builds, crane):
        first = builds.get()
        other = attrs.evolve(
            crane, parameters=(attrs.evolve(crane.parameters[0], nominal=0.3), *crane.parameters[1:])
        )
        second = plant_fmu(other)
        assert first.guid != second.guid
        assert first.folder != second.folder

    @pytest.mark.slow
    @pytest.mark.usefixtures("compiled_once")
    @pytest.mark.parametrize("kind", ["*.xml", "*.fmu", "binaries/*/*", "checksums.json"])
    @pytest.mark.parametrize("damage", ["truncated", "missing", "altered"])
    def test_is_mended(self, new_cache, builds, crane, kind, damage):
        folder = builds.get().folder
        (path,) = folder.glob(kind)
        content = path.read_bytes()
        if damage == "missing":
            path.unlink()
        else:
            # a new file: a library that is loaded must not change under the process
            path.unlink()
            half = len(content) // 2
            path.write_bytes(
                content[:half] if damage == "truncated" else content[:half] + b"?" + content[half + 1 :]
            )
        builds.get()
        assert builds.count == 2
        assert path.read_bytes() == content
        assert works(crane)

    @pytest.mark.slow
    @pytest.mark.usefixtures("compiled_once")
    @pytest.mark.parametrize("listing", ["[]", "{}", '"text"', "3", '{"gone": "00"}', "\udcff"])
    def test_is_mended_when_its_listing_is_something_else(self, new_cache, builds, listing):
        path = builds.get().folder / "checksums.json"
        path.write_bytes(listing.encode("utf-8", errors="surrogateescape"))
        builds.get()
        assert builds.count == 2

    @pytest.mark.slow
    def test_is_the_same_in_every_folder(self, new_cache, cache, builds, monkeypatch):
        archives = [builds.get().archive]
        share_zig(cache, new_cache / "deeper")
        monkeypatch.setenv("GEN_PROFILE_CACHE", str(new_cache / "deeper"))
        archives.append(builds.get().archive)
        assert builds.count == 2
        assert archives[0] != archives[1]
        assert archives[0].read_bytes() == archives[1].read_bytes()

    @pytest.mark.slow
    def test_is_built_by_two_processes_at_once(self, new_cache):
        commands = [[sys.executable, "-c", BUILD]] * 2
        processes = [
            subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for command in commands
        ]
        results = [process.communicate() for process in processes]
        assert [process.returncode for process in processes] == [0, 0], results
        paths = {Path(words.decode().strip()) for words, _ in results}
        assert len(paths) == 1
        assert is_intact(paths.pop().parent)
        assert not list(new_cache.glob("build-*"))

    @pytest.mark.slow
    @pytest.mark.usefixtures("compiled_once")
    def test_needs_no_home(self, cache, temporary_folder, builds, crane, monkeypatch):
        """As for a user of a container whom the list of users does not know."""

        def unknown(_):
            raise KeyError("no such user")

        share_zig(cache, temporary_folder / f"gen-profile-{os.geteuid()}")
        for variable in ("HOME", "XDG_CACHE_HOME", "GEN_PROFILE_CACHE"):
            monkeypatch.delenv(variable, raising=False)
        monkeypatch.setattr("pwd.getpwuid", unknown)
        assert builds.get().folder.is_relative_to(temporary_folder)
        assert works(crane)

    @pytest.mark.usefixtures("compiled_once")
    @pytest.mark.parametrize("obstacle", ["a file", "a folder that does not take files"])
    def test_falls_back_when_the_cache_cannot_be_written(
        self, obstacle, tmp_path, cache, temporary_folder, builds, crane, monkeypatch
    ):
        share_zig(cache, temporary_folder / f"gen-profile-{os.geteuid()}")
        named = tmp_path / "file" / "cache" if obstacle == "a file" else Path("/proc/self")
        (tmp_path / "file").write_text("in the way")
        monkeypatch.setenv("GEN_PROFILE_CACHE", str(named))
        assert builds.get().folder.is_relative_to(temporary_folder)
        builds.get()
        assert builds.count == 1
        assert works(crane)

    @pytest.mark.usefixtures("compiled_once")
    def test_is_read_from_a_cache_that_cannot_be_written(self, new_cache, builds, monkeypatch):
        first = builds.get()

        def refuse(*_):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr("gen_profile_fmu.building.cache.write_entry", refuse)
        assert builds.get() == first

    def test_says_where_it_could_not_be_written(self, tmp_path, builds, monkeypatch):
        in_the_way = tmp_path / "file"
        in_the_way.write_text("in the way")
        monkeypatch.setenv("GEN_PROFILE_CACHE", str(in_the_way))
        monkeypatch.setattr("tempfile.tempdir", str(in_the_way))
        with pytest.raises(CosimulationError, match=r"There is no folder .*file: .*GEN_PROFILE_CACHE"):
            builds.get()
        assert builds.count == 0


class TestFoldersOfOthers:
    """What is in the cache is loaded and run: what others could have laid there is not."""

    @pytest.fixture
    def laid(self, tmp_path, monkeypatch):
        """Lay an entry whose checksums fit into a cache, as another user would."""
        folder = tmp_path / "shared"
        folder.mkdir()
        write_entry(folder / "entry", {"library": b"another user's"})
        monkeypatch.setenv("GEN_PROFILE_CACHE", str(folder))
        return folder

    def found(self):
        return (cached("entry", lambda _: {"library": b"our own"}) / "library").read_bytes()

    def test_what_this_user_laid_is_taken(self, laid, temporary_folder):
        assert self.found() == b"another user's"
        assert not list(temporary_folder.iterdir())

    @pytest.mark.parametrize("whose", ["cache", "entry", "file", "list"])
    @pytest.mark.parametrize(
        "trap", ["another user's", *["open to a group"][: os.geteuid() == 0], "open to all"]
    )
    def test_what_others_could_have_laid_is_not(self, laid, temporary_folder, monkeypatch, whose, trap):
        entry = laid / "entry"
        place = {"cache": laid, "entry": entry, "file": entry / "library", "list": entry / "checksums.json"}[
            whose
        ]
        if trap == "another user's":
            give_away(place, monkeypatch)
        else:
            place.chmod(place.stat().st_mode | (0o020 if trap == "open to a group" else 0o002))
            if os.geteuid() == 0:  # a group of the user's own number is his own
                os.chown(place, -1, 12345)
        assert self.found() == b"our own"

    def test_another_folder_is_used_and_named(self, laid, temporary_folder, caplog):
        laid.chmod(0o777)
        for _ in range(2):
            assert self.found() == b"our own"
        assert [path.name for path in temporary_folder.iterdir()] == [f"gen-profile-{os.geteuid()}"]
        (sentence,) = caplog.messages  # once
        assert sentence == f"Not used as a cache: {laid}: others may write there, and what it holds is run."

    @pytest.mark.parametrize("renamed_by", ["all", "owners"])
    def test_a_cache_in_a_folder_where_others_rename_is_not_used(self, laid, temporary_folder, renamed_by):
        laid.parent.chmod(0o777 if renamed_by == "all" else 0o1777)
        assert self.found() == (b"our own" if renamed_by == "all" else b"another user's")

    def test_a_link_into_a_folder_of_others_is_not_followed(self, laid, temporary_folder, monkeypatch):
        link = laid.with_name("link")
        link.symlink_to(laid)
        monkeypatch.setenv("GEN_PROFILE_CACHE", str(link))
        assert self.found() == b"another user's"
        laid.chmod(0o777)
        assert self.found() == b"our own"

    @pytest.mark.parametrize("trap", ["open to others", "a link", "a file", "another user's"])
    def test_nor_the_one_among_temporary_files(self, laid, temporary_folder, trap, monkeypatch):
        laid.chmod(0o777)
        private = temporary_folder / f"gen-profile-{os.geteuid()}"
        if trap == "a link":
            private.symlink_to(laid)
        elif trap == "a file":
            private.write_text("")
        else:
            private.mkdir(mode=0o700)
            if trap == "open to others":
                private.chmod(0o777)
            else:
                give_away(private, monkeypatch)
                monkeypatch.setattr("gen_profile_fmu.building.cache.cache_folders", lambda: [laid, private])
        with pytest.raises(CosimulationError, match=r"no folder to keep .*shared: others may write there"):
            self.found()

    def test_one_that_is_new_is_private(self, temporary_folder, monkeypatch):
        monkeypatch.setenv("GEN_PROFILE_CACHE", str(temporary_folder / "a" / "b"))
        before = os.umask(0)
        try:
            entry = cached("entry", lambda _: {"folder/file": b""})
        finally:
            os.umask(before)
        assert [path.stat().st_mode & 0o777 for path in (entry, *entry.parents[:2], entry / "folder")] == [
            0o700
        ] * 4


def give_away(path, monkeypatch):
    """Make a file another user's, which only root can; for others it says that it is."""
    if os.geteuid() == 0:
        os.chown(path, 12345, -1)
        return
    lstat = Path.lstat

    def given_away(one):
        mode, inode, device, links, _, *rest = lstat(one)
        return os.stat_result((mode, inode, device, links, 12345, *rest)) if one == path else lstat(one)

    monkeypatch.setattr(Path, "lstat", given_away)


def test_the_cache_is_the_users(monkeypatch):
    monkeypatch.delenv("GEN_PROFILE_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/somewhere")
    first, *_ = cache_folders()
    assert first.name == "gen-profile"


def test_an_entry_is_written_whole_or_not_at_all(tmp_path, monkeypatch):
    entry = tmp_path / "entry"
    write_entry(entry, {"folder/file": b"old"})
    assert is_intact(entry)

    def fail(*_):
        raise OSError("No space left on device")

    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="No space"):
        write_entry(entry, {"folder/file": b"new"})
    assert (entry / "folder" / "file").read_bytes() == b"old"
    assert [path.name for path in (entry / "folder").iterdir()] == ["file"]
