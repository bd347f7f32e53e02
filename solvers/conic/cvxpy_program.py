"""The associated contact model written in cvxpy, for any of its conic solvers.

    minimise ½ ‖R y‖² + bᵀy      subject to   y_N ≥ 0,   ‖y_T‖ ≤ a + μ y_N      for every contact, Λ = y times its unit

with G = RᵀR: R = W̃ where the factors are known, else from the eigenvalues of G. Units and regularisation are those of
``programs``. The linear term is a parameter: cvxpy compiles the program once, and later runs replace b alone.
"""

import importlib
import time
import warnings
from typing import Any, ClassVar

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import SolverError
from .programs import ConicResult, Ended, Scaling, friction_parts

_OPTIONS: dict[str, tuple[tuple[str, ...], str, str]] = {
    "CLARABEL": (("tol_gap_abs", "tol_gap_rel", "tol_feas"), "max_iter", "time_limit"),
    "SCS": (("eps_abs", "eps_rel"), "max_iters", "time_limit_secs"),
    "OSQP": (("eps_abs", "eps_rel"), "max_iter", "time_limit"),
    "ECOS": (("abstol", "reltol", "feastol"), "max_iters", ""),
    "CVXOPT": (("abstol", "reltol", "feastol"), "max_iters", ""),
    "PROXQP": (("eps_abs", "eps_rel"), "max_iter", ""),
    "PIQP": (("eps_abs", "eps_rel"), "max_iter", ""),
}
"""What solvers call their tolerances, their limit of iterations and their limit of time; others keep their defaults."""

BUNDLED_CONIC = "CLARABEL"
"""A conic solver that is installed with cvxpy."""

BUNDLED_QUADRATIC = "OSQP"
"""A quadratic solver that is installed with cvxpy."""

FIRST_ORDER_ITERATIONS = 100_000
"""Most iterations of a splitting method, whose iterations are cheap."""


def cvxpy() -> Any:
    """Return cvxpy, imported when it is first needed: it takes more than a second."""
    return importlib.import_module("cvxpy")


def check_solver(name: str, cones: bool) -> None:
    """Raise ``SolverError`` unless cvxpy has the solver ``name``, and it takes second-order cones if ``cones``."""
    if name in (BUNDLED_CONIC, *([] if cones else [BUNDLED_QUADRATIC])):
        return  # without importing cvxpy
    known = installed(cones)
    if name in known:
        return
    cp, names = cvxpy(), ", ".join(known)
    if name in cp.installed_solvers():
        need = "second-order cones" if cones else "quadratic objectives"
        raise SolverError(f"the solver {name!r} of cvxpy does not take {need}; {names} do.")
    if name in cp.settings.SOLVERS:
        raise SolverError(f"cvxpy knows the solver {name!r}, but it is not installed; install it, or take {names}.")
    raise SolverError(f"cvxpy knows no solver {name!r}; installed are {names}.")


def takes_cones(name: str) -> bool:
    """Whether the installed solver ``name`` takes second-order cones."""
    return name == BUNDLED_CONIC or name in installed(cones=True)


def installed(cones: bool) -> list[str]:
    """Return the installed solvers of cvxpy that take second-order cones, or quadratic objectives."""
    cp = cvxpy()
    defines = importlib.import_module("cvxpy.reductions.solvers.defines")
    names = []
    for name in cp.installed_solvers():
        conic = defines.SOLVER_MAP_CONIC.get(name)
        has_cones = conic is not None and cp.SOC in conic.SUPPORTED_CONSTRAINTS
        if has_cones or (not cones and name in defines.SOLVER_MAP_QP):
            names.append(name)
    return names


class CvxpyProgram:
    """The program over impulses; see ``programs.ConicProgram``."""

    can_be_careful: ClassVar[bool] = False

    def __init__(self, problem: ContactProblem, solver: str, weight: FloatArray | None = None) -> None:
        cp = cvxpy()
        self._problem, self._solver = problem, solver
        self._scaling = scaling = Scaling(problem)
        self._impulses = cp.Variable(problem.n_rows)
        self._linear = cp.Parameter(problem.n_rows)
        root = _root(problem)
        if weight is not None:
            root = sp.vstack([sp.csc_array(root), sp.diags_array(np.sqrt(weight))], format="csc")
        root = root @ sp.diags_array(scaling.impulse / np.sqrt(scaling.energy))
        objective = 0.5 * cp.sum_squares(root @ self._impulses) + self._linear @ self._impulses
        self._program = cp.Problem(cp.Minimize(objective), _constraints(problem, scaling, self._impulses))
        self._linear.value = np.zeros(problem.n_rows)
        self._program.get_problem_data(solver)  # compiles, and keeps what it compiled

    def run(
        self, velocity: FloatArray, accuracy: float, iterations: int, seconds: float, is_careful: bool = False
    ) -> ConicResult:
        """See ``ConicProgram``."""
        cp = cvxpy()
        self._linear.value = velocity * (self._scaling.impulse / self._scaling.energy)
        tolerances, most_iterations, most_seconds = _OPTIONS.get(self._solver, ((), "", ""))
        options: dict[str, float] = dict.fromkeys(tolerances, accuracy)
        if most_iterations:
            options[most_iterations] = max(1, min(FIRST_ORDER_ITERATIONS, iterations))
        if most_seconds:
            options[most_seconds] = max(seconds, 1e-3)
        began = time.perf_counter()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of inaccuracy, which the judge measures
                self._program.solve(solver=self._solver, warm_start=False, **options)
            ended = {cp.OPTIMAL: Ended.CONVERGED, cp.UNBOUNDED: Ended.UNBOUNDED}.get(
                self._program.status, Ended.GAVE_UP
            )
        except cp.error.SolverError:
            ended = Ended.GAVE_UP
        taken = time.perf_counter() - began
        found = self._impulses.value
        impulses = np.full(self._problem.n_rows, np.nan) if found is None else self._scaling.impulse * found
        stats = self._program.solver_stats
        count = getattr(stats, "num_iters", None) if stats is not None else None
        return ConicResult(impulses, int(count or 1), taken, ended)

    def regularised(self, weight: FloatArray) -> "CvxpyProgram":
        """See ``ConicProgram``."""
        return CvxpyProgram(self._problem, self._solver, weight)


def _root(problem: ContactProblem) -> Any:
    """Return R with G = RᵀR."""
    if problem.factors is not None:
        return problem.factors.scaled_directions
    values, vectors = np.linalg.eigh(problem.delassus().toarray())
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T


def _constraints(problem: ContactProblem, scaling: Scaling, impulses: Any) -> list[Any]:
    """Return y_N ≥ 0 for all contacts, and the friction discs, those of equally many rows together."""
    cp = cvxpy()
    layout, normal = problem.layout, scaling.lanes[:, 0]
    constraints = []
    unilateral = normal[(normal >= 0) & ~layout.is_bilateral]
    if len(unilateral):
        constraints.append(impulses[unilateral] >= 0.0)
    for lanes, coefficients, bounds in friction_parts(problem, scaling):
        for count in range(1, 1 + lanes.shape[1]):
            blocks = np.flatnonzero((lanes >= 0).sum(axis=1) == count)
            if not len(blocks):
                continue
            mu, own, held = coefficients[blocks], normal[blocks], normal[blocks] >= 0
            pick = sp.csr_array((mu[held], (np.flatnonzero(held), own[held])), shape=(len(blocks), problem.n_rows))
            bound, rows = pick @ impulses + bounds[blocks], lanes[blocks, :count]
            if count == 1:
                constraints.append(cp.abs(impulses[rows[:, 0]]) <= bound)
            else:
                constraints.append(cp.SOC(bound, cp.vstack([impulses[row] for row in rows.T]), axis=0))
    return constraints
