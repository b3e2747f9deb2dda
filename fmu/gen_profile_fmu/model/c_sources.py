"""C sources of an FMU: CasADi's equations, the tables, and the hand-written files."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from gen_profile.dynamics.problem import symbolic as sym
from gen_profile.dynamics.problem.dynamics import Dynamics
from gen_profile.dynamics.problem.symbolic import Function
from gen_profile.motion.profile import Profile
from gen_profile_exporters.templates import filled
from gen_profile_fmu.model.variables import DERIVATIVES, STATES, FmuVariable, Kind, Type, VariableTable

_FOLDER = Path(__file__).parents[1] / "c"
TEMPLATES = _FOLDER / "templates"
FEWEST_POWERS = 4  # so that there is a jerk
# of CasADi's text: all that it exports, and there the functions that only call the one with the equations
_EXPORTED = r"^CASADI_SYMBOL_EXPORT [^{\n]*\{(?:[^\n]*\}\n|.*?^\}\n)\n?"
_LEFT_OVER = r"^static const casadi_int casadi_s\d+\[.*\n|^#define casadi_[fs]\d+ .*\n"
_WRAPPER = r"CASADI_SYMBOL_EXPORT int (\w+)\([^)]*\) ?\{\s*return (casadi_f\d+)\("


def hand_written(folder: str, *names: str) -> dict[str, str]:
    """Read hand-written files of a folder by their names; once compiled, all lie side by side."""
    return {name: (_FOLDER / folder / name).read_text(encoding="utf-8") for name in names}


def model_sources(*names: str) -> dict[str, str]:
    """Read the hand-written files of a model, and those that every model has."""
    return hand_written("models", "model.h", *names)


def equations_source(equations: Dynamics) -> str:
    """Write a plant's equations as C, with the arguments that equations.h declares."""
    e = equations
    arguments = {
        "q_u": e.q_u,
        "dq_u": e.dq_u,
        "q_a": e.q_a,
        "dq_a": e.dq_a,
        "input": e.ddq_a,
        "parameters": e.p,
    }
    seeds = {name: sym.symbols(f"change_of_{name}", column.shape[0]) for name, column in arguments.items()}
    everything, change = sym.column(list(arguments.values())), sym.column(list(seeds.values()))
    tangents = [sym.directional(expression, everything, change) for expression in (e.ddq_u, e.outputs)]
    changes = {f"change_of_{name}": column for name, column in seeds.items()}
    text = sym.c_source(
        Function("equations_acceleration", arguments, e.ddq_u),
        Function("equations_jump", arguments, e.input_matrix @ e.ddq_a),
        Function("equations_outputs", arguments, e.outputs),
        Function("equations_tangent", {**arguments, **changes}, *tangents),
    )
    return f'#include "equations.h"\n{_bare(text)}'


def _bare(text: str) -> str:
    """Leave of CasADi's text what is called: the functions, under their own names, and what helps them.

    All of it becomes static: it would clash where several FMUs are linked into one program. What CasADi adds,
    to ask functions for their names, sparsity and memory, would be unused.
    """
    names = {internal: name for name, internal in re.findall(_WRAPPER, text)}
    bare = re.sub(_EXPORTED, "", text, flags=re.M | re.S)
    bare = re.sub(_LEFT_OVER, "", bare, flags=re.M)
    bare = re.sub(r"^(casadi_real|casadi_int|void|int) (?=casadi_\w+\()", r"static \1 ", bare, flags=re.M)
    bare = re.sub(r"casadi_f\d+", lambda match: names[match[0]], bare)
    return re.sub(r"(, int mem\) \{\n)", r"\1  (void)arg, (void)res, (void)iw, (void)w, (void)mem;\n", bare)


def variables_header(table: VariableTable, n_a: int, n_u: int, constants: Mapping[str, str]) -> str:
    """Write the table of variables.

    Parameters
    ----------
    table : VariableTable
    n_a, n_u : int
        Number of actuated and unactuated coordinates.
    constants : mapping of str to str
        Further macros.
    """
    states = next((block for block in STATES if block in table.blocks), None)
    counts = {"N_A": n_a, "N_U": n_u, "N_VALUES": len(table.variables), "N_STATES": len(table.states)}
    offsets = {block: table.offset(block) for block in table.blocks}
    offsets["STATES"] = 0 if states is None else table.offset(states)
    offsets.setdefault(DERIVATIVES, 0)
    return filled(
        TEMPLATES / "variables.h",
        counts=", ".join(f"{name} = {value}" for name, value in counts.items()),
        offsets=_lines(f"    {block} = {offset}" for block, offset in offsets.items()),
        types=", ".join(type_.name for type_ in Type),
        kinds=", ".join(kind.name for kind in Kind),
        constants="".join(f"#define {name} ({value})\n" for name, value in constants.items()),
        rows=_lines(map(_variable_row, table.variables)),
    )


def motion_table(profile: Profile) -> str:
    """Write a motion's numbers."""
    segments, powers, axes = profile.coefficients.shape
    padded = np.zeros((segments, max(powers, FEWEST_POWERS), axes))
    padded[:, :powers] = profile.coefficients
    rows = ("    {" + ", ".join(map(_numbers, segment)) + "}" for segment in padded)
    return filled(
        TEMPLATES / "motion_table.h",
        segments=segments,
        powers=padded.shape[1],
        axes=axes,
        knots=_numbers(profile.knots),
        target=_numbers(profile.target),
        final_velocity=_numbers(profile.final_velocity),
        rows=_lines(rows),
    )


def _numbers(values: object) -> str:
    return "{" + ", ".join(repr(float(value)) for value in np.asarray(values)) + "}"


def _lines(items: Iterable[str]) -> str:
    return ",\n".join(items)


def _variable_row(variable: FmuVariable) -> str:
    lower = "-DBL_MAX" if variable.lower is None else repr(float(variable.lower))
    upper = "DBL_MAX" if variable.upper is None else repr(float(variable.upper))
    return (
        f'    {{"{variable.name}", {variable.type.name}, {variable.kind.name}, '
        f"{float(variable.start)!r}, {lower}, {upper}, {variable.nominal!r}}}"
    )
