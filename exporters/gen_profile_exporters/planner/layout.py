"""Structured Text as all compilers take it, and short."""

import re

FOR, END_FOR = re.compile(r"( *)FOR (\w+) := (.+) TO (.+) DO(.*)"), re.compile(r"( *)END_FOR;(.*)")


def with_while_loops(text: str) -> str:
    """Write FOR loops as WHILE loops: since 2024 matiec leaves out those of a single pass."""
    lines, counters = list[str](), list[str]()
    for line in text.split("\n"):
        if loop := FOR.fullmatch(line):
            margin, counter, first, last, more = loop.groups()
            within = f"< {last[:-4]}" if last.endswith(" - 1") else f"<= {last}"
            lines += [f"{margin}{counter} := {first};", f"{margin}WHILE {counter} {within} DO{more}"]
            counters.append(counter)
        elif ends := END_FOR.fullmatch(line):
            margin, more, counter = *ends.groups(), counters.pop()
            lines += [f"{margin}    {counter} := {counter} + 1;", f"{margin}END_WHILE;{more}"]
        else:
            lines.append(line)
    return "\n".join(lines)


def narrow(text: str) -> str:
    """Indent by tabs, which keeps the text short."""
    return re.sub("(?m)^ +", lambda margin: "\t" * (len(margin[0]) // 4), text)
