"""What was given in words, and what a person may have meant by an unknown word or a text for a number."""

import math
import re
from collections.abc import Iterable, Mapping
from datetime import date, time
from functools import cache
from pathlib import Path

from gen_profile.support.phrase import Phrase

MOST_NAMES = 3  # names to suggest
DASHES = re.compile("[\N{HYPHEN}-\N{EM DASH}\N{MINUS SIGN}\N{FULLWIDTH HYPHEN-MINUS}]")  # for a minus
MIN_SIMILARITY = 0.65  # difflib's ratio from which on a word is a misspelling of another


@cache
def _synonyms() -> dict[str, list[str]]:
    """Read other words for what is called so here, in the languages and products that users come from."""
    lines = (Path(__file__).parents[1] / "lists" / "synonyms.txt").read_text("utf-8").splitlines()
    return {name: words.split() for name, _, words in (line.partition(": ") for line in lines)}


def suggestion(word: str, known: Iterable[str]) -> str:
    """End a sentence: ``; did you mean 'x'?`` where something similar is known, else the list of what is."""
    known = list(known)
    near = meant(word, known)
    if near:
        return Phrase("; did you mean {names}?", names=listed(near))
    return Phrase(" (known: {names}).", names=", ".join(known) or "none")


def listed(names: Iterable[str]) -> str:
    """Write ``'a', 'b' or 'c'``."""
    *others, last = (repr(name) for name in names)
    return Phrase("{others} or {last}", others=", ".join(others), last=last) if others else last


def meant(word: str, known: Iterable[str]) -> list[str]:
    """Find the names, `MOST_NAMES` at most, that a person may mean: by meaning, by a part, or misspelt."""
    names, word = list(known), str(word).strip().lower()  # from Python, it may be no text
    same = [name for name in names if name.lower() == word]
    by_meaning = [name for name in names if word in _synonyms().get(name, ())]
    by_part = [
        name
        for name in names
        if word in (*re.split(r"[-_. ]", name.lower()), name.lower().rstrip("0123456789"))
        or (len(word) > 2 and name.lower().startswith(word))
        or _abbreviates(word.split("-"), name.lower().split("-"))
    ]
    candidates = same or by_meaning or by_part if word else []
    return candidates[:MOST_NAMES] or _misspelt(word, names)


def _abbreviates(word: list[str], name: list[str]) -> bool:
    """Tell whether a word of several parts has the beginning of each part of a name, as 2h-ei of 2hump-ei."""
    pairs = zip(word, name, strict=False)
    return 1 < len(word) == len(name) and all(part and whole.startswith(part) for part, whole in pairs)


def _misspelt(word: str, names: Iterable[str]) -> list[str]:
    """Find the name most like a word, parts that both have aside: a tower crane is no bridge crane."""

    def likeness(name: str) -> float:
        own, other = word.split("-"), name.lower().split("-")
        shared = {*own} & {*other} if 2 * len({*own} & {*other}) <= len(own) else set[str]()
        rests = ["-".join(part for part in parts if part not in shared) for parts in (own, other)]
        from difflib import SequenceMatcher  # noqa: PLC0415  (of which --help has no need)

        return SequenceMatcher(None, rests[0], rests[1]).ratio()

    best = max(names, key=likeness, default="")
    return [best] if best and likeness(best) >= MIN_SIMILARITY else []


def finite_number(text: str) -> float:
    """Read a number, of a typographic minus, too; NaN where a text is none, or is infinite."""
    try:
        value = float(text.replace("\N{MINUS SIGN}", "-"))
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def number_meant(text: str) -> str:
    """Continue a sentence about a text in a number's place: ``; write a decimal point: 6.0``."""
    text = text.strip()
    if (typed := DASHES.sub("-", text)) != text and math.isfinite(finite_number(typed)):
        return Phrase("; write the minus of the keyboard: {number}", number=typed)
    if comma := re.fullmatch(r"([+-]?[0-9]+),([0-9]+)", text):
        return Phrase("; write a decimal point: {number}", number=f"{comma[1]}.{comma[2]}")
    if re.fullmatch(r"[+-]?[0-9.]+,[0-9]+|[+-]?[0-9,]+\.[0-9]+", text) and "," in text:
        return "; write a decimal point, and nothing between thousands"
    if share := re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*%", text):
        return Phrase("; write a share: {share:g}", share=float(share[1]) / 100.0)
    if re.fullmatch(r"[+-]?(\.[0-9]+|[0-9]+\.)", text):
        return "; write a digit on both sides of the decimal point"
    if re.fullmatch(r"[+-]?[0-9.,]+\s*[A-Za-zµμ°][^0-9]*[23²³]?", text):
        return "; write the number alone, in SI units (m, s, kg, rad)"
    if re.fullmatch(r"[+-]?[0-9]+(\.[0-9]+)?", text):
        return "; write it without quotes"
    return ""


def found(value: object, number: bool = True) -> str:
    """Name a value in a sentence, never at length, and of a text how it might be a number."""
    match value:
        case None:
            return "nothing"
        case bool():
            return str(value).lower()
        case int() if abs(value) >= 10**18:
            return "a whole number of more than 18 digits"
        case int() | float():
            return repr(value)
        case str():
            hint = number_meant(value) if number else ""
            return Phrase("text {text}{hint}", text=repr(value[:60]), hint=hint)
        case Mapping():
            return "a table"
        case list() | tuple():
            short = len(value) <= 3 and all(type(item) in {int, float} for item in value)
            return str(list(value)) if short else "an array"
        case date() | time():
            return "a date or time"
        case _:  # from Python
            name = type(value).__name__
            return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"
