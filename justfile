# What a change must pass: quick tests, and slow ones that are near to what changed, or whose turn it is.
check: lint
    told=$(.ci/base) && pytest -n auto --turn "${told#* }" --changed "$(git diff --name-only "${told% *}")"

# All that there is, whatever turn it is.
check-all: lint coverage oldest

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

# Not in CI, where it would take another half a minute.
types-on-macos:
    mypy --platform darwin --cache-dir .mypy_cache/darwin

[private]
layers:
    lint-imports

# The whole suite with branch coverage; pyproject.toml holds the least share.
coverage:
    pytest -n auto --cov --cov-report=term

# The quick tests with the oldest dependencies that pyproject.toml allows, parametrised ones in their first case, in
# one process, which collects once.
oldest:
    uv venv --quiet --clear --python 3.11 build/oldest
    uv pip install --quiet --python build/oldest --resolution lowest-direct -e '.[dev]'
    build/oldest/bin/pytest -p no:xdist --assert=plain -m "not slow" --first-cases

# Some tests: just test tests/generator -k shaper
test *arguments:
    pytest {{ arguments }}

# Format and fix what ruff can fix.
fix:
    ruff check --fix
    ruff format

# These pages as a site, in build/site: any warning, such as of a link that leads nowhere, is an error.
site:
    sphinx-build -q -E -W --keep-going -c docs . build/site

# Wheel and source archive in dist, built twice to the same bytes and tried from the built file, with their hashes
# and a bill of materials (CycloneDX) of what that file installs.
distributions:
    rm -rf dist build/again build/fresh
    uv build --quiet --out-dir dist
    uv build --quiet --out-dir build/again
    rm -f dist/.gitignore build/again/.gitignore
    diff --recursive dist build/again
    uv venv --quiet build/fresh
    uv pip install --quiet --python build/fresh dist/*.whl
    build/fresh/bin/gen-profile --version
    build/fresh/bin/gen-profile --export plc --out build/fresh/tried
    uvx --quiet --from cyclonedx-bom cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --output-file dist/sbom.cdx.json build/fresh/bin/python
    cd dist && sha256sum *.whl *.tar.gz *.json | tee SHA256SUMS

# The same of a version that CHANGELOG.md dates, from a checkout without changes.
release:
    git diff --quiet HEAD || { echo "There are changes that are not committed."; exit 1; }
    grep -Eq "^## \\[$(sed -n 's/^version = \"\(.*\)\"/\1/p' pyproject.toml)\\] – 20[0-9-]{8}$" CHANGELOG.md || { echo "CHANGELOG.md: date this version."; exit 1; }
    just distributions

# A folder for Linux with Python and a C compiler inside, for engineers who have none, and its archive. It needs glibc
# as new as this computer's, so build it on an old one. By hand: takes minutes.
standalone:
    python standalone/build.py dist/gen-profile-linux
    uvx --quiet --from cyclonedx-bom cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --output-file dist/gen-profile-linux/sbom.cdx.json dist/gen-profile-linux/python/bin/python3
    du --summarize --si dist/gen-profile-linux
    dist/gen-profile-linux/gen-profile --version
    XZ_OPT=-T0 tar --create --xz --sort=name --owner=0 --group=0 --numeric-owner --mtime=@0 --directory dist --file dist/gen-profile-linux.tar.xz gen-profile-linux

# The same for Windows with an installer, from python.org's embeddable package; elsewhere by Wine and Debian's nsis.
standalone-windows embeddable:
    python standalone/build.py --windows {{ embeddable }} dist/gen-profile-windows
    makensis -V2 -DVERSION=$(sed -n 's/^version = "\(.*\)"/\1/p' pyproject.toml) -DFOLDER=$PWD/dist/gen-profile-windows -DOUT=$PWD/dist/gen-profile-setup.exe standalone/installer.nsi

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

# Random cranes, and what three logged runs of each tell of them.
learning *arguments:
    python tests/generator/learning_trials.py {{ arguments }}

# Random programs of Structured Text: do the C made of them and the tests' interpreter agree?
interpreters *arguments:
    python tests/exporters/interpreters.py {{ arguments }}

# A planner block with a sensor beside the baselines of cranebench, as the table in docs/planner-algorithm.md.
crane-bench *arguments:
    python tests/other_systems/crane_bench.py {{ arguments }}
