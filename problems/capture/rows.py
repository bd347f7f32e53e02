"""The force laws of the constraint rows of MuJoCo.

=========================== =======================================================================================
equality                    a bilateral law per row
friction loss               planar friction with a fixed bound, the time step h times the loss
limit of a joint or tendon  a unilateral law
contact, ``condim`` 1       a unilateral law
``condim`` 3                the same with sliding friction
``condim`` 4                the same with sliding and spinning friction, each with its own bound
``condim`` 6                the same with sliding, and with rolling and spinning friction under one bound
=========================== =======================================================================================

μ is ``contact.friction``, not ``contact.mu``, which is divided by √impratio. If friction differs between the axes of a
law, velocities are scaled by s_k = μ_k/μ_1 and impulses by 1/s_k: the elliptic cone becomes circular, and work is
unchanged.

A pyramidal contact has the rows J_N ± μ_k J_k of the Jacobian instead of J_N and J_k, with forces f₊ and f₋. Half their
sum is J_N, and half their difference is μ_k J_k. The forces are f_N = Σ (f₊ + f₋) and f_k = μ_k (f₊ − f₋), as in
``mju_decodePyramid``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp

from ..arrays import FloatArray
from ..contact.laws import LawKind, Laws
from ..engine_model import EngineSet
from .mujoco_import import mujoco

EMPTY = 1e-14
"""A contact row whose norm is below this fraction of the largest row norm of the contact counts as zero, for example
friction normal to a planar model."""

IMMOBILE = "it moves no degree of freedom; give one of its bodies a joint, or remove it from the model"
"""Reason for not capturing a row of zeros."""

_SLIDING = (LawKind.PLANAR_FRICTION, LawKind.SPATIAL_FRICTION)
_ROLLING = (LawKind.PLANAR_ROLLING, LawKind.SPATIAL_ROLLING, LawKind.ROLLING_AND_SPINNING)


@dataclass(frozen=True)
class RefusedRow:
    """A constraint row of an engine without a corresponding law.

    Attributes:
        row: its index among the rows of the engine.
        name: name of its constraint.
        reason: why it has no law, and the remedy.
    """

    row: int
    name: str
    reason: str


@dataclass(frozen=True, eq=False)
class CapturedRows:
    """The rows of a problem in terms of the rows of an engine.

    Attributes:
        laws: the force laws.
        velocity: T with W = Jᵀ Tᵀ, shape (n_rows, n_engine_rows).
        force: S with Λ = h S f, shape (n_rows, n_engine_rows).
        surface_velocity: part of the relative velocity that is due to moving surfaces [m/s], shape (n_rows,).
        keys: name of each contact or single law, in row order; contacts of one pair share a key.
        anchors: point of each contact in the frames of its geometries [m], 0 for single laws, shape (len(keys), 2, 3).
        refused: rows of the engine without a law.
    """

    laws: Laws
    velocity: sp.csr_array[Any]
    force: sp.csr_array[Any]
    surface_velocity: FloatArray
    keys: tuple[str, ...]
    anchors: FloatArray
    refused: tuple[RefusedRow, ...]


@dataclass
class _Row:
    """One row of a problem, as coefficients of engine rows by index, and its surface velocity [m/s]."""

    velocity: dict[int, float]
    force: dict[int, float]
    surface: float = 0.0

    def scaled(self, factor: float) -> "_Row":
        """Return the row with its velocity multiplied and its force divided by ``factor``."""
        velocity = {row: factor * value for row, value in self.velocity.items()}
        force = {row: value / factor for row, value in self.force.items()}
        return _Row(velocity, force, factor * self.surface)


@dataclass
class _RowCollector:
    """The laws, rows and keys collected so far, in order."""

    kind: list[LawKind] = field(default_factory=list)
    friction: list[float] = field(default_factory=list)
    bound: list[float] = field(default_factory=list)
    partner: list[int] = field(default_factory=list)
    rows: list[_Row] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)
    anchors: list[FloatArray] = field(default_factory=list)
    refused: list[RefusedRow] = field(default_factory=list)

    def add_law(
        self, kind: LawKind, rows: Sequence[_Row], friction: float = 0.0, bound: float = 0.0, partner: int = -1
    ) -> int:
        """Add a law with its rows, and return its index."""
        self.kind.append(kind)
        self.friction.append(friction)
        self.bound.append(bound)
        self.partner.append(partner)
        self.rows.extend(rows)
        return len(self.kind) - 1

    def add_key(self, key: str, anchors: FloatArray | None = None) -> None:
        """Add the key of a contact or a single law; ``anchors`` are 0 if None."""
        self.keys.append(key)
        self.anchors.append(np.zeros((2, 3)) if anchors is None else anchors)


def captured_rows(model: Any, data: Any, jacobian: sp.csr_array[Any]) -> CapturedRows:
    """Return the force laws of the constraint rows of a step.

    Args:
        model: MuJoCo's model.
        data: MuJoCo's data, after a step.
        jacobian: J, shape (n_engine_rows, n_dofs).
    """
    types = mujoco().mjtConstraint
    groups, row = [], 0
    while row < data.nefc:
        kind, group = int(data.efc_type[row]), [_Row({row: 1.0}, {row: 1.0})]
        if kind in (types.mjCNSTR_CONTACT_PYRAMIDAL, types.mjCNSTR_CONTACT_ELLIPTIC):
            contact = data.contact[int(data.efc_id[row])]
            group = _frame_rows(contact, row, kind == types.mjCNSTR_CONTACT_PYRAMIDAL)
        groups.append((row, group))
        row += len({engine_row for part in group for engine_row in part.force})
    norms = _norms([part for _, group in groups for part in group], jacobian)
    collector, end = _RowCollector(), 0
    for row, group in groups:
        start, end = end, end + len(group)
        if len(group) > 1 or int(data.efc_type[row]) == types.mjCNSTR_CONTACT_FRICTIONLESS:
            _add_contact_rows(collector, model, data, data.contact[int(data.efc_id[row])], group, norms[start:end])
        else:
            _add_single_row(collector, model, data, row, float(norms[start]))
    return _captured(collector, int(data.nefc))


def engine_sets(data: Any) -> tuple[list[int], list[int], FloatArray]:
    """Return the sets of MuJoCo's own model.

    Returns:
        ``EngineSet`` and first row of each set, and the coefficient of each row, shape (n_engine_rows,).
    """
    types = mujoco().mjtConstraint
    kinds, first_rows, coefficient, row = [], [], np.ones(data.nefc), 0
    while row < data.nefc:
        kind, length = int(data.efc_type[row]), 1
        if kind == types.mjCNSTR_CONTACT_ELLIPTIC:
            contact = data.contact[int(data.efc_id[row])]
            length = int(contact.dim)
            coefficient[row + 1 : row + length] = contact.friction[: length - 1]
            form = EngineSet.ELLIPTIC_CONE
        elif kind == types.mjCNSTR_EQUALITY:
            form = EngineSet.LINE
        elif kind in (types.mjCNSTR_FRICTION_DOF, types.mjCNSTR_FRICTION_TENDON):
            form = EngineSet.INTERVAL
        else:
            form = EngineSet.HALF_LINE
        kinds.append(int(form))
        first_rows.append(row)
        row += length
    return kinds, first_rows, coefficient


def _add_single_row(collector: _RowCollector, model: Any, data: Any, row: int, norm: float) -> None:
    """Add a row that is not part of a contact."""
    module = mujoco()
    types, objects = module.mjtConstraint, module.mjtObj
    kind, index = int(data.efc_type[row]), int(data.efc_id[row])
    supported = {
        int(types.mjCNSTR_EQUALITY): ("equality", objects.mjOBJ_EQUALITY, LawKind.BILATERAL),
        int(types.mjCNSTR_FRICTION_DOF): ("friction of joint", objects.mjOBJ_JOINT, LawKind.PLANAR_FRICTION),
        int(types.mjCNSTR_FRICTION_TENDON): ("friction of tendon", objects.mjOBJ_TENDON, LawKind.PLANAR_FRICTION),
        int(types.mjCNSTR_LIMIT_JOINT): ("limit of joint", objects.mjOBJ_JOINT, LawKind.UNILATERAL),
        int(types.mjCNSTR_LIMIT_TENDON): ("limit of tendon", objects.mjOBJ_TENDON, LawKind.UNILATERAL),
    }
    if kind not in supported:
        collector.refused.append(
            RefusedRow(row, f"row {row}", f"its type {kind} is not known; remove it from the model")
        )
        return
    label, object_kind, law = supported[kind]
    index = int(model.dof_jntid[index]) if kind == types.mjCNSTR_FRICTION_DOF else index
    key = f"{label} {_name(model, object_kind, index)}"
    if norm == 0.0:
        collector.refused.append(RefusedRow(row, key, IMMOBILE))
        return
    bound = model.opt.timestep * float(data.efc_frictionloss[row]) if law == LawKind.PLANAR_FRICTION else 0.0
    collector.add_law(law, [_Row({row: 1.0}, {row: 1.0})], bound=bound)
    collector.add_key(key)


def _frame_rows(contact: Any, first: int, is_pyramid: bool) -> list[_Row]:
    """Return the first ``condim`` rows of a contact's frame: normal, two tangents, spin, two rolling axes."""
    dim = int(contact.dim)
    surface = [0.0, *contact.surfacevel, 0.0, 0.0]
    if not is_pyramid:
        return [_Row({first + k: 1.0}, {first + k: 1.0}, surface[k]) for k in range(dim)]
    edges = range(first, first + 2 * (dim - 1))
    rows = [_Row({first: 0.5, first + 1: 0.5}, dict.fromkeys(edges, 1.0))]
    for k in range(1, dim):
        mu, plus = float(contact.friction[k - 1]), first + 2 * (k - 1)
        half = 0.5 / mu
        rows.append(_Row({plus: half, plus + 1: -half}, {plus: mu, plus + 1: -mu}, surface[k]))
    return rows


def _add_contact_rows(
    collector: _RowCollector, model: Any, data: Any, contact: Any, frame: list[_Row], norms: FloatArray
) -> None:
    """Add the normal row of a contact, and its nonzero friction rows."""
    names = [_geometry(model, contact, side) for side in (0, 1)]
    normal = collector.add_law(LawKind.UNILATERAL, frame[:1])
    collector.add_key(" | ".join(names), np.array([_anchor(data, contact, side) for side in (0, 1)]))
    friction = [0.0, *map(float, contact.friction)]
    for indices, kinds in (((1, 2), _SLIDING), ((3, 4, 5), _ROLLING)):
        kept = [k for k in indices if k < len(frame) and norms[k] > EMPTY * norms.max()]
        if kept:
            first = friction[kept[0]]
            rows = [frame[k].scaled(friction[k] / first) for k in kept]
            collector.add_law(kinds[len(kept) - 1], rows, friction=first, partner=normal)


def _norms(rows: Sequence[_Row], jacobian: sp.csr_array[Any]) -> FloatArray:
    """Return the norm of the Jacobian of each row of a problem, shape (len(rows),)."""
    products = _coefficients([row.velocity for row in rows], jacobian.shape[0]) @ jacobian
    norms: FloatArray = np.sqrt(products.multiply(products).sum(axis=1))
    return norms


def _anchor(data: Any, contact: Any, side: int) -> FloatArray:
    """Return the point of a contact in the frame of a geometry, or of the world if it is deformable [m], shape (3,)."""
    index, point = int(contact.geom[side]), np.array(contact.pos)
    if index < 0:
        return point
    anchor: FloatArray = data.geom_xmat[index].reshape(3, 3).T @ (point - data.geom_xpos[index])
    return anchor


def _geometry(model: Any, contact: Any, side: int) -> str:
    """Return the name of the geometry, or the part of the deformable body, on one side of a contact."""
    index = int(contact.geom[side])
    if index >= 0:
        return _name(model, mujoco().mjtObj.mjOBJ_GEOM, index, "geom ")
    parts = ("flex", contact.flex), ("element", contact.elem), ("vertex", contact.vert)
    return " ".join(f"{word} {int(ids[side])}" for word, ids in parts if ids[side] >= 0)


def _name(model: Any, kind: Any, index: int, prefix: str = "") -> str:
    """Return the name of an object of a model, or ``prefix`` and its index if it has none."""
    return mujoco().mj_id2name(model, kind, index) or f"{prefix}{index}"


def _captured(collector: _RowCollector, n_engine_rows: int) -> CapturedRows:
    """Return the collected rows as arrays."""
    laws = Laws.in_order(
        np.array(collector.kind, dtype=np.int8),
        np.array(collector.friction),
        np.array(collector.bound),
        np.array(collector.partner, dtype=np.int64),
    )
    return CapturedRows(
        laws,
        _coefficients([row.velocity for row in collector.rows], n_engine_rows),
        _coefficients([row.force for row in collector.rows], n_engine_rows),
        surface_velocity=np.array([row.surface for row in collector.rows]),
        keys=tuple(collector.keys),
        anchors=np.array(collector.anchors, dtype=np.float64).reshape(-1, 2, 3),
        refused=tuple(collector.refused),
    )


def _coefficients(rows: Sequence[dict[int, float]], n_engine_rows: int) -> sp.csr_array[Any]:
    """Return the coefficients of rows as a matrix, shape (len(rows), n_engine_rows)."""
    starts = np.cumsum([0, *map(len, rows)])
    columns = [column for row in rows for column in row]
    values = np.array([value for row in rows for value in row.values()], dtype=np.float64)
    return sp.csr_array((values, np.array(columns, dtype=np.int64), starts), shape=(len(rows), n_engine_rows))
