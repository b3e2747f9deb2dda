"""Motions with their certificates, for tests."""

from command_line import run_here


def certified(folder, preset, *overrides, form="csv"):
    """Design a motion and prove it; the artefact and its certificate."""
    words = [word for override in overrides for word in ("--set", override)]
    made = run_here("--preset", preset, *words, "--export", form, "--certify", "--out", folder)
    assert made.code == 0, made.err
    artefact = next(folder / one.name for one in folder.iterdir() if one.suffix in (".csv", ".st"))
    return artefact, artefact.with_name(f"{artefact.name}.certificate.json")


def contents(artefact, certificate):
    return (
        artefact.read_bytes(),
        artefact.with_name("manifest.json").read_bytes(),
        certificate.read_bytes(),
    )
