"""What the shell offers at a press of Tab, by the installed program."""

import pytest
from command_line import run_process


def offered(*words):
    """Complete the last word as bash does."""
    outcome = run_process(
        _GEN_PROFILE_COMPLETE="bash_complete",
        COMP_WORDS=" ".join(["gen-profile", *words]),
        COMP_CWORD=str(len(words)),
    )
    assert outcome.err == ""
    return {line.partition(",")[2] for line in outcome.out.splitlines()}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("",), {"check", "compare", "design", "formats", "plants", "presets"}),
        (("com",), {"compare"}),
        (("--",), {"--export", "--out", "--preset", "--set", "--json", "--help", "--version"}),
        (("--ex",), {"--export"}),
        (("--export", ""), {"can", "csv", "plc"}),
        (("--export", "p"), {"plc"}),
        (("--export", "plc", "--export", "c"), {"can", "csv"}),
        (("design", "--export", "p"), {"plc"}),
        (("--preset", ""), {"paper", "paper-beta0", "paper-beta20", "paper-beta50"}),
        (("compare", "--preset", "paper-beta2"), {"paper-beta20"}),
        (("check", "x.csv", "--pre"), {"--preset"}),
    ],
)
def test_offers(words, expected):
    assert expected <= offered(*words)


def test_offers_only_what_begins_so():
    assert offered("com") == {"commission", "compare"}
    assert offered("--export", "p") == {"plc", "plcopen-xml"}


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_prints_a_script_to_source(shell):
    outcome = run_process(_GEN_PROFILE_COMPLETE=f"{shell}_source")
    assert outcome.code in (0, 1)
    if outcome.code == 1:  # click wants a newer bash than this machine's
        assert shell == "bash" and "version" in outcome.err
    else:
        assert "_GEN_PROFILE_COMPLETE" in outcome.out
