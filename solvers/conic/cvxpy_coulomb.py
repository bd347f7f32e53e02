"""Solve problems with Coulomb friction by the fixed-point iteration of ``fixed_point``, with the solvers of cvxpy.

Each iteration solves the program

    minimise ½ ‖R y‖² + bᵀy      subject to   y_N ≥ 0,   ‖y_T‖ ≤ a + μ y_N      for every contact,

with G = RᵀR. R is W̃ if the factors are known; otherwise it is computed from the eigenvalues of G. y is Λ in the units
of ``programs.Scaling``. The program may be regularised as in ``programs``. The linear term is a parameter: cvxpy
compiles the program once, and later runs replace only b. ``ClarabelCoulomb`` solves the same program without cvxpy,
which saves the time for compiling.
"""

import importlib
import time
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.solver import SolverError
from .fixed_point import FixedPointMethod, check_memory
from .programs import ConicResult, ConicStatus, Scaling, friction_parts, unsupported_reason

MAX_CONTACTS = 2500
"""Largest number of contacts; compiling takes 0.5 GB for 1000 contacts and 1.4 GB for 2000."""


class _OptionNames(NamedTuple):
    """Names of the options of a solver: its tolerances, iteration limit and time limit; empty if it has none."""

    tolerances: tuple[str, ...] = ()
    iteration_limit: str = ""
    time_limit: str = ""


_OPTION_NAMES = {
    "CLARABEL": _OptionNames(("tol_gap_abs", "tol_gap_rel", "tol_feas"), "max_iter", "time_limit"),
    "SCS": _OptionNames(("eps_abs", "eps_rel"), "max_iters", "time_limit_secs"),
    "OSQP": _OptionNames(("eps_abs", "eps_rel"), "max_iter", "time_limit"),
    "ECOS": _OptionNames(("abstol", "reltol", "feastol"), "max_iters"),
    "CVXOPT": _OptionNames(("abstol", "reltol", "feastol"), "max_iters"),
    "PROXQP": _OptionNames(("eps_abs", "eps_rel"), "max_iter"),
    "PIQP": _OptionNames(("eps_abs", "eps_rel"), "max_iter"),
}
"""Option names of each solver; other solvers keep their defaults."""

BUNDLED_CONIC = "CLARABEL"
"""A conic solver that cvxpy installs."""

BUNDLED_QUADRATIC = "OSQP"
"""A quadratic solver that cvxpy installs."""

MAX_SOLVER_ITERATIONS = 100_000
"""Largest iteration limit that a solver receives. It is large because iterations of splitting methods are cheap."""


@dataclass(frozen=True)
class CvxpyCoulomb(FixedPointMethod):
    """Solve Coulomb friction by De Saxcé's fixed-point iteration over convex models in cvxpy.

    Spatial friction needs second-order cones. Planar friction and frictionless contact give quadratic programs, which
    quadratic solvers accept too. Without friction, one or two programs suffice.

    Attributes:
        solver: name of a conic or quadratic solver that cvxpy finds.
        memory: number of pairs that Anderson acceleration of the outer iteration keeps, 0 for no acceleration.

    Raises:
        SolverError: if cvxpy has no such solver, the solver is not installed, or an option is out of range.
    """

    solver: str = BUNDLED_CONIC
    memory: int = 5

    def __post_init__(self) -> None:
        check_solver(self.solver)
        check_memory(self.memory)

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        laws = problem.laws
        if (laws.row_count > 1).any() and not supports_cones(self.solver):
            is_spatial = (laws.row_count[~laws.is_rolling] > 1).any()
            friction = "spatial friction" if is_spatial else "rolling friction about several axes"
            return f"it has {friction}, and {self.solver} does not support second-order cones"
        if problem.n_contacts > MAX_CONTACTS:
            return (
                f"it has {problem.n_contacts} contacts; with more than {MAX_CONTACTS}, cvxpy needs gigabytes to compile"
            )
        return super().supports(problem) or unsupported_reason(problem, "delassus")

    def program(self, problem: ContactProblem) -> "CvxpyProgram":
        """Return the compiled program."""
        return CvxpyProgram(problem, self.solver)


def cvxpy() -> Any:
    """Return the module cvxpy; importing it takes more than a second, so it is imported at first use."""
    return importlib.import_module("cvxpy")


def check_solver(name: str) -> None:
    """Raise ``SolverError`` unless the solver ``name`` of cvxpy is installed and supports quadratic objectives."""
    given: object = name
    if not isinstance(given, str):
        raise SolverError(f"the solver of cvxpy has a name, such as {BUNDLED_CONIC!r}, not {name!r:.60}.")
    if name in (BUNDLED_CONIC, BUNDLED_QUADRATIC):
        return  # avoids importing cvxpy
    known = installed_solvers(cones=False)
    if name in known:
        return
    cp, names = cvxpy(), ", ".join(known)
    if name in cp.installed_solvers():
        raise SolverError(f"the solver {name!r} of cvxpy does not support quadratic objectives; use one of {names}.")
    if name in cp.settings.SOLVERS:
        raise SolverError(f"the solver {name!r} of cvxpy is not installed; install it, or use one of {names}.")
    raise SolverError(f"cvxpy has no solver {name!r}; use one of {names}.")


def supports_cones(name: str) -> bool:
    """Return whether the installed solver ``name`` supports second-order cones."""
    return name == BUNDLED_CONIC or name in installed_solvers(cones=True)


def installed_solvers(cones: bool) -> list[str]:
    """Return the names of installed solvers of cvxpy.

    Args:
        cones: whether to omit quadratic solvers that do not support second-order cones.
    """
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
    """A cvxpy program with the impulses as variables; see ``programs.ConicProgram``."""

    def __init__(self, problem: ContactProblem, solver: str, weight: FloatArray | None = None) -> None:
        """Compile the program.

        Args:
            problem: the problem.
            solver: name of an installed solver of cvxpy.
            weight: weights w [1/kg] of the regularisation diag(w), shape (n_rows,); none by default.
        """
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
        data: dict[str, Any] = self._program.get_problem_data(solver)[0]  # compiles the program and caches the result
        parts: list[Any] = [getattr(part, "data", None) if sp.issparse(part) else part for part in data.values()]
        self._is_finite = all(np.isfinite(part).all() for part in parts if isinstance(part, np.ndarray))

    def run(self, velocity: FloatArray, accuracy: float, max_iterations: int, max_seconds: float) -> ConicResult:
        """Solve with another linear term; see ``ConicProgram.run``."""
        cp = cvxpy()
        names = _OPTION_NAMES.get(self._solver, _OptionNames())
        options: dict[str, float] = dict.fromkeys(names.tolerances, accuracy)
        if names.iteration_limit:
            options[names.iteration_limit] = max(1, min(MAX_SOLVER_ITERATIONS, max_iterations))
        if names.time_limit:
            options[names.time_limit] = max(max_seconds, 1e-3)
        failure, start_time = np.full(self._problem.n_rows, np.nan), time.perf_counter()
        linear = velocity * (self._scaling.impulse / self._scaling.energy)
        if not (self._is_finite and np.isfinite(linear).all()):  # cvxpy refuses other numbers
            return ConicResult(failure, 1, time.perf_counter() - start_time, ConicStatus.GAVE_UP)
        self._linear.value = linear
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # warnings report inaccuracy, which the judge measures
                self._program.solve(solver=self._solver, warm_start=False, **options)
        except cp.error.SolverError:  # the program keeps the values of the run before
            return ConicResult(failure, 1, time.perf_counter() - start_time, ConicStatus.GAVE_UP)
        elapsed = time.perf_counter() - start_time
        status = {cp.OPTIMAL: ConicStatus.CONVERGED, cp.UNBOUNDED: ConicStatus.UNBOUNDED}.get(
            self._program.status, ConicStatus.GAVE_UP
        )
        scaled_impulses = self._impulses.value
        impulses = failure if scaled_impulses is None else self._scaling.impulse * scaled_impulses
        stats = self._program.solver_stats
        n_iterations = getattr(stats, "num_iters", None) if stats is not None else None
        return ConicResult(impulses, int(n_iterations or 1), elapsed, status)

    def regularised(self, weight: FloatArray) -> "CvxpyProgram":
        """Return the program with G + diag(w) in place of G; see ``ConicProgram.regularised``."""
        return CvxpyProgram(self._problem, self._solver, weight)


def _root(problem: ContactProblem) -> Any:
    """Return R with G = RᵀR, with n_rows columns; negative eigenvalues of G are rounding errors and count as zero."""
    if problem.factors is not None:
        return problem.factors.scaled_directions
    values, vectors = np.linalg.eigh(problem.delassus().toarray())
    return np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T


def _constraints(problem: ContactProblem, scaling: Scaling, impulses: Any) -> list[Any]:
    """Return the constraints: y_N ≥ 0 for all contacts, and friction discs, grouped by their number of rows."""
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
            mu, normal_rows, has_normal = coefficients[blocks], normal[blocks], normal[blocks] >= 0
            entries = mu[has_normal], (np.flatnonzero(has_normal), normal_rows[has_normal])
            weighted_normals = sp.csr_array(entries, shape=(len(blocks), problem.n_rows))
            bound, rows = weighted_normals @ impulses + bounds[blocks], lanes[blocks, :count]
            if count == 1:
                constraints.append(cp.abs(impulses[rows[:, 0]]) <= bound)
            else:
                constraints.append(cp.SOC(bound, cp.vstack([impulses[row] for row in rows.T]), axis=0))
    return constraints
