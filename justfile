# What CI runs, and what a change must pass.
check: lint coverage

# Format, lint, types and import layers.
[parallel]
lint: style types types-on-windows layers

[private]
style:
    ruff format --check
    ruff check

[private]
types:
    mypy

[private]
types-on-windows:
    mypy --platform win32 --cache-dir .mypy_cache/win32

[private]
layers:
    lint-imports

# The whole suite with branch coverage; pyproject.toml holds the least share.
coverage:
    pytest -n auto --cov --cov-report=term

# Some tests: just test tests/generator -k shaper
test *arguments:
    pytest {{ arguments }}

# Format and mend what ruff can mend.
fix:
    ruff check --fix
    ruff format

# Timings, printed and not judged.
bench:
    pytest -s tests/benchmarks

# Random specs of all machines: how planning each one ends, and how long it takes.
battery *arguments:
    python tests/generator/battery.py {{ arguments }}

# Random sequences of knobs in the studio: how they end, and what they leave behind.
knobs *arguments:
    python tests/end_to_end/knob_sequences.py {{ arguments }}

# Changed texts of the planner block: which of them its proof lets pass.
mutants *arguments:
    python tests/generator/mutants.py {{ arguments }}

# Random programs of Structured Text: do the C made of them and the tests' interpreter agree?
interpreters *arguments:
    python tests/exporters/interpreters.py {{ arguments }}

# A planner block with a sensor beside the baselines of cranebench, as the table in docs/planner-algorithm.md.
crane-bench *arguments:
    python tests/other_systems/crane_bench.py {{ arguments }}
