"""Contact problems as dual problems of Kamino, and the import of Kamino.

Kamino (a part of Newton, Tsounis et al.) builds its dual problem from a model of bodies. Here its arrays are filled
with the numbers of a contact problem: one world, a dense D = G in single precision, v_f = c and no preconditioner. Its
rows are, in this order, bilateral rows, rows with fixed bounds, unilateral rows, and rows T1, T2, N of contacts. The
data are scaled by units of the problem (``Scaling``). G then has a diagonal of about 1 and c is at most 1, so that
Kamino's absolute tolerances have the same meaning for every problem.

This module uses private interfaces of Kamino. Only the tested version is therefore supported.
"""

import sys
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

from ...problems.arrays import FloatArray, IntArray
from ...problems.contact.laws import LawKind, Laws
from ...problems.contact.matrices.memory import to_dense
from ...problems.contact.problem import ContactProblem
from ..conic.programs import Scaling

TESTED_VERSION = "1.8"
"""Prefix of the tested versions of Newton."""

MAX_ROWS = 3000
"""Largest number of rows; with more, a factorisation takes many seconds, and it cannot be interrupted."""


def unsupported_reason(problem: ContactProblem) -> str | None:
    """Return why Kamino's constraints cannot represent ``problem``, or None."""
    laws = problem.laws
    slides = laws.partner >= 0
    is_contact = slides & (laws.kind == LawKind.SPATIAL_FRICTION) & (laws.fixed_bound == 0.0)
    is_bounded = ~slides & (laws.kind == LawKind.PLANAR_FRICTION)
    if not (laws.is_unilateral | laws.is_bilateral | is_contact | is_bounded).all():
        kinds = ", ".join(sorted(laws.counts()))
        return (
            "Kamino supports spatial contacts, unilateral and bilateral laws and planar friction with a fixed bound, "
            f"but the laws are {kinds}"
        )
    if problem.n_rows > MAX_ROWS:
        return f"it has {problem.n_rows} rows, and the dense factors of more than {MAX_ROWS} take too long"
    if problem.allow_asymmetric and abs(problem.delassus() - problem.delassus().T).max() > 0:
        return "G is not symmetric"
    return None


def _rows_of(laws: Laws) -> tuple[IntArray, list[int]]:
    """Return the row of the problem for each row of Kamino, and the number of laws in its four groups."""
    slides = laws.kind == LawKind.SPATIAL_FRICTION
    is_frictionless = laws.is_unilateral.copy()
    is_frictionless[laws.partner[slides]] = False
    masks = laws.is_bilateral, laws.kind == LawKind.PLANAR_FRICTION, is_frictionless
    groups = [laws.first_row[mask] for mask in masks]
    tangent, normal = laws.first_row[slides], laws.first_row[laws.partner[slides]]
    contacts = np.stack([tangent, tangent + 1, normal], axis=1)
    return np.concatenate([*groups, contacts.ravel()]), [*map(len, groups), len(contacts)]


class DualSolver:
    """Kamino's proximal ADMM, with the dual problem of a contact problem.

    Args:
        problem: a supported problem with rows.
        acceleration: whether steps are accelerated.
        penalty: ρ, in scaled units.
    """

    def __init__(self, problem: ContactProblem, acceleration: bool, penalty: float) -> None:
        self._warp = _import_warp()
        scaling, laws = Scaling(problem), problem.laws
        self._order, self._groups = _rows_of(laws)
        self._impulse = scaling.impulse[self._order]
        self._unit = self._impulse / scaling.energy
        scales = self._impulse / np.sqrt(scaling.energy)
        delassus = to_dense(problem.delassus()[self._order][:, self._order], "use a solver over the factors")
        self._matrix = scales[:, None] * delassus * scales
        self._velocity = problem.free_velocity[self._order] * self._unit
        n_bilateral, n_bounded, _, _ = self._groups
        bounds = laws.fixed_bound[laws.kind == LawKind.PLANAR_FRICTION]
        self._dual = self._make_dual(
            bounds / self._impulse[n_bilateral : n_bilateral + n_bounded],
            laws.friction_coefficient[laws.kind == LawKind.SPATIAL_FRICTION],
        )
        config = _kamino("solvers.padmm.solver").PADMMSolver.Config
        self._config = config(use_acceleration=acceleration, rho_0=penalty, warmstart_scale=1.0)
        self._solver = self._make_solver()
        self.solve(np.zeros(problem.n_rows), 1.0, 1)  # compiles and loads the kernels for problems of this size

    def solve(self, impulses: FloatArray, tolerance: float, iterations: int) -> tuple[FloatArray, int, bool]:
        """Continue from Λ over rows [N s].

        Args:
            impulses: Λ, shape (n_rows,).
            tolerance: tolerance of Kamino's residuals, in scaled units.
            iterations: largest number of iterations.

        Returns:
            The new Λ, the number of iterations, and whether Kamino's residuals meet the tolerance.
        """
        solver, types = self._solver, _kamino("solvers.padmm.types")
        limits = {f"{name}_tolerance": tolerance for name in ("primal", "dual", "compl")}
        config = replace(self._config, max_iterations=iterations, **limits)
        solver.data.config.assign([types.convert_config_to_struct(config)])
        scaled = impulses[self._order] / self._impulse
        solver.data.solution.lambdas.assign(scaled.astype(np.float32))
        solver.data.solution.v_plus.assign((self._matrix @ scaled + self._velocity).astype(np.float32))
        self._dual.data.D.assign(self._matrix.astype(np.float32).ravel())  # a solve leaves its penalty on the diagonal
        solver.warmstart(self._dual, None, None)
        solver.solve(self._dual)
        status, new_impulses = solver.data.status.numpy()[0], np.empty(len(impulses))
        new_impulses[self._order] = solver.data.solution.lambdas.numpy() * self._impulse
        return new_impulses, int(status["iterations"]), bool(status["converged"])

    def _make_dual(self, bounds: FloatArray, friction: FloatArray) -> Any:
        """Return the parts of Kamino's ``DualProblem`` that the solver reads."""
        core, n_rows = _kamino("linalg.core"), len(self._order)
        operator = core.DenseLinearOperatorData()
        operator.info, operator.mat = core.DenseSquareMultiLinearInfo(), self._floats(self._matrix)
        operator.info.finalize([n_rows], dtype=self._warp.float32, itype=self._warp.int32, device="cpu")
        delassus = _kamino("dynamics.delassus").DelassusOperator()
        delassus._operator = operator
        delassus._solver = _kamino("linalg.linear").LLTBlockedSolver(operator=operator, device="cpu")
        n_bilateral, n_bounded, n_unilateral, n_contacts = self._groups
        first = np.cumsum([0, n_bilateral, n_bounded, n_unilateral])
        counts = {"njc": n_bilateral, "nbc": n_bounded, "nl": n_unilateral, "nc": n_contacts}
        offsets = {"bcio": 0, "lio": 0, "cio": 0, "iio": 0, "bcgo": first[1], "lcgo": first[2], "ccgo": first[3]}
        data = _kamino("dynamics.dual").DualProblemData(
            num_worlds=1,
            max_of_maxdims=n_rows,
            **{name: self._integer(value) for name, value in (counts | offsets).items()},
            **{name: getattr(operator.info, name) for name in ("maxdim", "dim", "mio", "vio")},
            D=operator.mat,
            P=self._floats(np.ones(n_rows)),
            v_f=self._floats(self._velocity),
            bound_lower=self._floats(-bounds),
            bound_upper=self._floats(bounds),
            mu=self._floats(friction),
        )
        return SimpleNamespace(data=data, delassus=delassus, _delassus=delassus, sparse=False)

    def _make_solver(self) -> Any:
        """Return Kamino's solver of one world of this size, which continues from its last solution."""
        dimensions = {
            "max_total_cts": len(self._order),
            "max_inequalities": sum(self._groups[1:]),
            "max_contacts": self._groups[-1],
        }
        size = _kamino("core.size").SizeKamino(
            num_worlds=1, **{f"{kind}_of_{name}": n for kind in ("sum", "max") for name, n in dimensions.items()}
        )
        model = _kamino("core.model")
        kamino_model = model.ModelKamino(
            _device=self._warp.get_device("cpu"), size=size, info=model.ModelKaminoInfo(num_worlds=1)
        )
        padmm = _kamino("solvers.padmm.solver")
        return padmm.PADMMSolver(
            kamino_model,
            self._config,
            padmm.PADMMWarmStartMode.INTERNAL,
            use_acceleration=self._config.use_acceleration,
        )

    def _floats(self, values: FloatArray) -> Any:
        single = np.asarray(values, dtype=np.float32).ravel()
        return self._warp.array(single, dtype=self._warp.float32, device="cpu")

    def _integer(self, value: int) -> Any:
        return self._warp.array([value], dtype=self._warp.int32, device="cpu")


def _import_warp() -> Any:
    """Import Warp and Newton without output, and without the viewer, whose library would reserve a gigabyte."""
    warp = import_module("warp")
    warp.config.log_level = warp.LOG_ERROR
    if "rerun" not in sys.modules:
        sys.modules["rerun"] = None  # type: ignore[assignment]  # makes it appear not installed
        try:
            import_module("newton")
        finally:
            del sys.modules["rerun"]
    return warp


def _kamino(module: str) -> Any:
    return import_module(f"newton._src.solvers.kamino._src.{module}")
