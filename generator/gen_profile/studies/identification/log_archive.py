"""Tables in archives: a workbook's first sheet (ECMA-376), or the CSV files that phyphox packs into one."""

import io
import re
import zipfile
from collections.abc import Iterator
from xml.etree import ElementTree

from gen_profile.support.errors import OutputError

SHEETS, STRINGS = re.compile(r"xl/worksheets/sheet(\d+)\.xml"), "xl/sharedStrings.xml"
_ASIDE = re.compile(r"(.*/)?(meta|__MACOSX)/.*|.*/\..*", re.IGNORECASE)  # what is no table of a measurement
_MAIN = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"


def table_in(content: bytes, source: str, most: int) -> bytes:
    """Take the table out of an archive.

    Parameters
    ----------
    content : bytes
    source : str
        Where it comes from, for errors.
    most : int
        Bytes that it may unpack to.

    Raises
    ------
    OutputError
        There is none, more than one, or it is damaged or too large.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            sheets = sorted(int(found[1]) for name in archive.namelist() if (found := SHEETS.fullmatch(name)))
            if sheets:
                return _sheet(archive, f"xl/worksheets/sheet{sheets[0]}.xml", source, most)
            tables = [
                one
                for one in archive.namelist()
                if one.lower().endswith(".csv") and not _ASIDE.fullmatch(one)
            ]
            if len(tables) == 1:
                return _unpacked(archive, tables[0], source, most)
    except (zipfile.BadZipFile, ElementTree.ParseError, NotImplementedError, RuntimeError) as error:
        template = "{source}: this archive or workbook is damaged ({problem}); save the table as CSV."
        raise OutputError(template, source=source, problem=error) from error
    if tables:
        template = "{source}: this archive holds {count} tables ({names}); unpack it, and name one of them."
        raise OutputError(template, source=source, count=len(tables), names=", ".join(tables)[:200])
    template = "{source}: this is a workbook or archive without a table; save the sheet as CSV."
    raise OutputError(template, source=source)


def _unpacked(archive: zipfile.ZipFile, name: str, source: str, most: int) -> bytes:
    """Unpack one file, no more than so many bytes of it."""
    with archive.open(name) as file:
        unpacked = file.read(most + 1)
    if len(unpacked) > most:
        template = "{source}: {name} unpacks to more than {most} MiB; cut the swing out of it."
        raise OutputError(template, source=source, name=name, most=most >> 20)
    return unpacked


def _sheet(archive: zipfile.ZipFile, name: str, source: str, most: int) -> bytes:
    """Write a sheet's cells between tabs."""
    shared = list[str]()
    if STRINGS in archive.namelist():
        texts = ElementTree.fromstring(_plain(_unpacked(archive, STRINGS, source, most)))
        shared = ["".join(part.text or "" for part in one.iter(f"{_MAIN}t")) for one in texts]
    rows = ElementTree.fromstring(_plain(_unpacked(archive, name, source, most))).iter(f"{_MAIN}row")
    try:
        return "\n".join("\t".join(_cells(row, shared)) for row in rows).encode("utf-8")
    except (IndexError, ValueError) as error:
        raise zipfile.BadZipFile(str(error)) from error


def _plain(document: bytes) -> bytes:
    """Refuse a document type: entities of one may unpack without end."""
    if b"<!DOCTYPE" in document:
        raise zipfile.BadZipFile("it declares a document type")
    return document


def _cells(row: ElementTree.Element, shared: list[str]) -> Iterator[str]:
    """Give a row's texts, with empty ones where cells are left out."""
    reached = 0
    for cell in row:
        letters = re.match(r"[A-Z]{1,3}", cell.get("r", ""))
        place = reached
        if letters:
            place = sum((ord(one) - 64) * 26**k for k, one in enumerate(reversed(letters[0]))) - 1
        yield from [""] * (place - reached)
        reached = max(place, reached) + 1
        text = "".join(part.text or "" for part in cell.iter() if part.tag in (f"{_MAIN}v", f"{_MAIN}t"))
        yield " ".join((shared[int(text)] if cell.get("t") == "s" else text).split())
