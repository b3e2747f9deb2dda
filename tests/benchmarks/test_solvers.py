"""How long a solve takes, beside general tools in the same run. Printed, not judged."""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable

import attrs
import numpy as np
import pytest
from generator.crane_problems import crane_problem
from generator.oracles.crane_optimal_control import CraneOptimalControl, direct_cost, direct_program
from scipy.integrate import solve_bvp

from gen_profile.dynamics.problem.pontryagin import optimality_system
from gen_profile.dynamics.problem.problem import Problem
from gen_profile.methods.solvers.direct import solver as direct
from gen_profile.methods.solvers.direct.set_up import DirectOptions
from gen_profile.methods.solvers.indirect import solver as indirect
from gen_profile.methods.solvers.indirect.boundary_value_problem import IndirectOptions, canonical_problem
from gen_profile.plants.registry import find_plant
from gen_profile.support.remembered import forget

JERK_AT_START = 25.867416  # m/s³, β = 50
REPEATS = 15


def best(run: Callable[[], object]) -> float:
    """Least time of several runs in s: what the machine can do when left alone."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        run()
        times.append(time.perf_counter() - began)
    return min(times)


def start_jerk(solution) -> float:
    """u(0) = −λ of the acceleration at the start."""
    return float(-solution.optimum.costates[0, 6])


def report(name: str, seconds: float, found: float) -> None:
    print(f"{name:28} {1e3 * seconds:9.1f} ms   u(0) off by {found - JERK_AT_START:+.1e}")


def boundary_value_problem(problem: Problem):
    """The same canonical equations and Jacobian, as `scipy.integrate.solve_bvp` takes them."""
    system = optimality_system(problem.plant, problem.desensitized, problem.effort)
    canonical = canonical_problem(problem, system)
    data = attrs.evolve(canonical.data, beta=problem.sway_weight, gamma=problem.sway_scale).row()
    n = system.layout.size
    target = np.zeros(n)
    target[system.layout.axis(0)] = 1.0

    def points(z):
        return system.flow(np.ascontiguousarray(z.T), data)

    mesh = np.linspace(0.0, 1.0, 31)
    guess = np.zeros((2 * n, len(mesh)))
    quintic = np.polynomial.Polynomial([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])
    for order in range(3):
        guess[system.layout.axis(order)] = quintic.deriv(order)(mesh) if order else quintic(mesh)

    def solve():
        return solve_bvp(
            lambda s, z: points(z)[:, :, 0].T,
            lambda a, b: np.concatenate([a[:n], b[:n] - target]),
            mesh,
            guess,
            fun_jac=lambda s, z: points(z)[:, :, 1:].transpose(1, 2, 0),
            tol=1e-6,
            max_nodes=20000,
        )

    def jerk(found):
        # u = −λ_a in units of the cost's scale
        at = system.quantities(np.ascontiguousarray(found.y[:, :1].T), data)
        return float(at[0, 2, 0])

    return solve, jerk


def test_beside_general_tools():
    problem = crane_problem()
    mine = {name: module.solve for name, module in (("indirect", indirect), ("direct", direct))}
    print()
    times = {}
    payload = problem.parameters["m2"]
    for name, solve in mine.items():
        solution = solve(problem)
        # new parameters every time, though none that would move the solution
        others = iter([crane_problem({"m2": payload * (1.0 + 1e-13 * k)}) for k in range(1, 1 + REPEATS)])
        times[name] = best(lambda solve=solve, others=others: solve(next(others)))
        print(
            f"{name:28} {1e3 * times[name]:9.1f} ms   u(0) off by {start_jerk(solution) - JERK_AT_START:+.1e}"
        )
        assert start_jerk(solution) == pytest.approx(JERK_AT_START, rel=1e-6)

    solve, jerk = boundary_value_problem(problem)
    found = solve()
    peer = best(solve)
    report("scipy solve_bvp, tol 1e-6", peer, jerk(found))

    began = time.perf_counter()
    oracle = CraneOptimalControl(problem.parameters, "jerk", None, 50.0, 50.0)
    direct_cost(oracle, 0.3, 3.0)
    general = time.perf_counter() - began
    print(f"{'CasADi + IPOPT, built anew':28} {1e3 * general:9.1f} ms")

    # 12 intervals of six points: the quickest mesh of which u(0), a multiplier, is right to 1e-6
    program, guess, _ = direct_program(oracle, 0.3, 3.0, 12, degree=6)
    multipliers = np.array(program(x0=guess, lbg=0.0, ubg=0.0)["lam_g"]).ravel()
    collocation = best(lambda: program(x0=guess, lbg=0.0, ubg=0.0))
    report("CasADi + IPOPT, built before", collocation, abs(float(multipliers[6])))

    def cold():
        optimality_system.cache_clear()
        forget()
        indirect.solve(problem)

    anew = best(cold)
    print(f"{'indirect, built anew':28} {1e3 * anew:9.1f} ms")
    for name, spent in times.items():
        print(
            f"{name}: {peer / spent:.0f} times faster than solve_bvp, "
            f"{collocation / spent:.1f} times faster than CasADi + IPOPT"
        )
    print(f"built anew: {general / anew:.1f} times faster than CasADi + IPOPT")


@pytest.mark.parametrize("intervals", [20, 60, 200, 600, 2000])
def test_growth_with_intervals(intervals):
    problem = crane_problem()
    for module, kind in ((indirect, IndirectOptions), (direct, DirectOptions)):
        options = kind(intervals=intervals, max_intervals=max(480, intervals))
        module.solve(problem, options=options)
        tracemalloc.start()
        forget()
        module.solve(problem, options=options)
        memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        forget()
        began = time.perf_counter()
        solution = module.solve(problem, options=options)
        spent = time.perf_counter() - began
        print(
            f"\n{solution.method:9} {intervals:5} intervals {1e3 * spent:9.1f} ms {memory / 2**20:7.1f} MB "
            f"{solution.status.name}",
            end="",
        )


@pytest.mark.parametrize("masses", range(1, 13))
def test_growth_with_states(masses):
    plant = find_plant(f"mass-spring-chain-{masses}")
    problem = Problem(
        plant=plant,
        parameters=plant.nominal(),
        start=(0.0,),
        target=(0.3,),
        duration=10.0,
        tau=None,
        desensitized=(),
        effort="jerk",
        sway_weight=0.0,
        sway_scale=None,
    )
    for module in (indirect, direct):
        module.solve(problem)
        forget()
        began = time.perf_counter()
        solution = module.solve(problem)
        spent = time.perf_counter() - began
        print(f"\n{solution.method:9} {masses:2} masses {1e3 * spent:9.1f} ms {solution.status.name}", end="")


@pytest.mark.parametrize("names", [(), ("L1",), ("L1", "m2"), ("L1", "L2", "m1", "m2")])
def test_growth_with_uncertain_parameters(names):
    problem = crane_problem(desensitized=names)
    for module in (indirect, direct):
        module.solve(problem)
        forget()
        began = time.perf_counter()
        solution = module.solve(problem)
        spent = time.perf_counter() - began
        left = f", {len(solution.redundant)} of them implied" if solution.redundant else ""
        print(f"\n{solution.method:9} {len(names)} parameters{left} {1e3 * spent:9.1f} ms", end="")
