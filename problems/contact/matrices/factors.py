"""The factors of a Delassus matrix: force directions W and inverse mass M⁻¹, with G = Wᵀ M⁻¹ W."""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache, partial
from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import ArrayLike

from ...arrays import FloatArray, ReadOnlyRecord, frozen, read_only, real_numbers, sealed
from ...compilation.interpretation import interpretable
from ...errors import ProblemError
from ..blocks import BlockLayout
from .block_diagonal import block_cholesky, block_inverse
from .pieces import Pieces, cut_into_pieces
from .user_matrices import as_matrix, check_finite, read_matrix, sparse_arrays, with_entries


@dataclass(frozen=True, eq=False)
class InverseMass(ReadOnlyRecord):
    """M⁻¹ with its root, computed once for all problems that share the object.

    Attributes:
        matrix: M⁻¹, symmetric positive definite and block diagonal, shape (n_dofs, n_dofs), scipy CSR.
        mass: M if M⁻¹ was computed from it, scipy CSR; ``None`` if M⁻¹ was given.
    """

    matrix: sp.csr_array[Any]
    mass: sp.csr_array[Any] | None = None
    _root_blocks: dict[int, FloatArray | None] = field(default_factory=dict, init=False, repr=False)

    @staticmethod
    def create(inverse_mass: Any) -> "InverseMass":
        """Return a checked, read-only M⁻¹.

        Args:
            inverse_mass: diagonal of M⁻¹, shape (n_dofs,), or M⁻¹, dense or scipy sparse, shape (n_dofs, n_dofs).

        Raises:
            ProblemError: if the shape is wrong, a number is not finite, or M⁻¹ is not symmetric positive definite.
        """
        if not sp.issparse(inverse_mass) and real_numbers(inverse_mass, "M⁻¹").ndim == 1:
            diagonal = frozen(inverse_mass, np.float64, "M⁻¹")
            pattern = _diagonal_pattern(len(diagonal))
            matrix = with_entries(pattern, diagonal, pattern.indices, pattern.indptr)
            check_finite(matrix, "M⁻¹")
        else:
            matrix = _read_square(inverse_mass, "M⁻¹")
        inverse = InverseMass(matrix)
        inverse.check()
        return inverse

    @staticmethod
    def of_mass(mass: Any) -> "InverseMass":
        """Return M⁻¹ computed from M block by block, together with M.

        Args:
            mass: M, symmetric positive definite, dense or scipy sparse, shape (n_dofs, n_dofs). Its blocks are the
                connected components of its nonzero entries, for any order of the degrees of freedom.

        Raises:
            ProblemError: if the shape is wrong, a number is not finite, M is not symmetric positive definite, or its
                inverse has more than ``MAX_ENTRIES`` entries.
        """
        checked_mass = _read_square(mass, "M")
        matrix = block_inverse(checked_mass)
        check_finite(matrix, "M⁻¹")
        inverse = InverseMass(matrix, checked_mass)
        inverse.check()
        return inverse

    def check(self) -> None:
        """Raise ``ProblemError`` unless M⁻¹ is positive definite."""
        _ = self.root_diagonal if self.is_diagonal else self.root

    @cached_property
    def is_diagonal(self) -> bool:
        """Whether M⁻¹ has no entries off its diagonal."""
        matrix = self.matrix
        return len(matrix.data) == matrix.shape[0] and np.array_equal(matrix.indices, np.arange(matrix.shape[0]))

    @cached_property
    def root_diagonal(self) -> FloatArray:
        """The diagonal of S, shape (n_dofs,), if M⁻¹ is diagonal.

        Raises:
            ProblemError: if an entry of M⁻¹ is not positive.
        """
        diagonal = self.matrix.data
        if (diagonal <= 0).any():
            dof = int(np.argmax(diagonal <= 0))
            raise ProblemError(f"M⁻¹[{dof}, {dof}] = {diagonal[dof]} must be positive.")
        return sealed(np.sqrt(diagonal))

    @cached_property
    def root(self) -> sp.csr_array[Any]:
        """S with M⁻¹ = S Sᵀ and the blocks of M⁻¹, shape (n_dofs, n_dofs).

        Raises:
            ProblemError: if M⁻¹ is not positive definite.
        """
        if not self.is_diagonal:
            return block_cholesky(self.matrix)
        return with_entries(self.matrix, self.root_diagonal, self.matrix.indices, self.matrix.indptr)

    def times(self, vector: FloatArray) -> FloatArray:
        """Return M⁻¹ x, shape (n_dofs,)."""
        product: FloatArray = self.matrix.data * vector if self.is_diagonal else self.matrix @ vector
        return product

    def root_times(self, vector: FloatArray) -> FloatArray:
        """Return S x with M⁻¹ = S Sᵀ, shape (n_dofs,)."""
        product: FloatArray = self.root_diagonal * vector if self.is_diagonal else self.root @ vector
        return product

    def fresh(self) -> "InverseMass":
        """Return a copy that shares no memory with this object and contains a copy of the root."""
        copy = InverseMass(self.matrix.copy(), None if self.mass is None else self.mass.copy())
        copy.__dict__["is_diagonal"] = self.is_diagonal
        if self.is_diagonal:
            copy.__dict__["root_diagonal"] = sealed(self.root_diagonal.copy())
        else:
            copy.__dict__["root"] = self.root.copy()
        return copy

    def root_blocks(self, length: int) -> FloatArray | None:
        """Return S in diagonal blocks of ``length`` rows, for ``Pieces.scaled``; None if S has entries outside them."""
        if length not in self._root_blocks:
            self._root_blocks[length] = self._cut_root(length)
        return self._root_blocks[length]

    def _cut_root(self, length: int) -> FloatArray | None:
        n_dofs = self.matrix.shape[0]
        if n_dofs % length:
            return None
        if self.is_diagonal:
            return self.root_diagonal
        blocks = sp.bsr_array(self.root, blocksize=(length, length))
        is_blocked = np.array_equal(blocks.indices, np.arange(n_dofs // length))
        return frozen(blocks.data, np.float64) if is_blocked else None


@dataclass(frozen=True, eq=False)
class Factors(ReadOnlyRecord):
    """W, M⁻¹ and the free motion of the system that a problem comes from; build it with ``create``.

    Attributes:
        directions: W as given: scipy CSC, shape (n_dofs, n_rows), or in pieces, one block per contact.
        inverse_mass: M⁻¹.
        free_motion: u_B + M⁻¹ h Δt with forces h, the velocity without contacts, shape (n_dofs,), or ``None``.
    """

    directions: sp.csc_array[Any] | Pieces
    inverse_mass: InverseMass
    free_motion: FloatArray | None = None

    @staticmethod
    def create(force_directions: Any, inverse_mass: Any, free_motion: ArrayLike | None = None) -> "Factors":
        """Return checked, read-only factors; see ``ContactProblem.from_factors`` for the arguments.

        Raises:
            ProblemError: if the shape is wrong, a number is not finite, or M⁻¹ is not positive definite.
        """
        directions = read_matrix(force_directions, "W", sp.csc_array)
        inverse = inverse_mass if isinstance(inverse_mass, InverseMass) else InverseMass.create(inverse_mass)
        n_dofs = directions.shape[0]
        if inverse.matrix.shape[0] != n_dofs:
            raise ProblemError(f"M⁻¹ must have shape ({n_dofs}, {n_dofs}) to go with W, got {inverse.matrix.shape}.")
        motion = None
        if free_motion is not None:
            motion = frozen(free_motion, np.float64, "free_motion")
            if motion.shape != (n_dofs,) or not np.isfinite(motion).all():
                raise ProblemError(f"free_motion must be {n_dofs} finite numbers, got shape {motion.shape}.")
        return Factors(directions, inverse, motion)

    @property
    def n_dofs(self) -> int:
        """Number of degrees of freedom."""
        return int(self.inverse_mass.matrix.shape[0])

    @property
    def n_rows(self) -> int:
        """Number of rows of the problem."""
        directions = self.directions
        return directions.n_blocks * directions.width if isinstance(directions, Pieces) else int(directions.shape[1])

    @cached_property
    def force_directions(self) -> sp.csc_array[Any]:
        """W, shape (n_dofs, n_rows), scipy CSC, read-only."""
        if not isinstance(self.directions, Pieces):
            return self.directions
        columns = self.directions.to_csc()
        read_only(columns.data, columns.indices, columns.indptr)
        return columns

    def scaled_pieces(self, layout: BlockLayout) -> Pieces:
        """Return W̃ = Sᵀ W in pieces, for the blocks of ``layout``."""
        directions = self.directions
        if isinstance(directions, Pieces) and directions.width == layout.width and layout.is_dense:
            blocks = self.inverse_mass.root_blocks(directions.length)
            if blocks is not None:
                return directions.scaled(blocks)
        if self.inverse_mass.is_diagonal:
            return cut_into_pieces(self.force_directions, self.inverse_mass.root_diagonal, layout)
        return cut_into_pieces(self.scaled_directions, sealed(np.ones(self.n_dofs)), layout)

    @cached_property
    def scaled_directions(self) -> sp.csc_array[Any]:
        """W̃ = Sᵀ W, so that G = W̃ᵀ W̃, shape (n_dofs, n_rows), columns sorted."""
        directions, inverse = self.force_directions, self.inverse_mass
        if inverse.is_diagonal:
            values = directions.data * inverse.root_diagonal[directions.indices]
            return with_entries(directions, values, directions.indices, directions.indptr)
        root = inverse.root.indptr, inverse.root.indices, inverse.root.data
        entries = multiply_by_root(*root, directions.indptr, directions.indices, directions.data)
        read_only(*entries)
        return with_entries(directions, *entries)

    def delassus_diagonal(self) -> FloatArray | None:
        """Return the diagonal of G [1/kg], shape (n_rows,), or None if it requires the pieces of W̃."""
        if isinstance(self.directions, Pieces) and self.inverse_mass.is_diagonal:
            return self.directions.delassus_diagonal(self.inverse_mass.matrix.data)
        return None

    def delassus_times(self, impulses: FloatArray) -> FloatArray:
        """Return Wᵀ M⁻¹ W Λ [m/s], shape (n_rows,)."""
        if isinstance(self.directions, Pieces):
            return self.directions.transposed_times(self.inverse_mass.times(self.directions.times(impulses)))
        product: FloatArray = self.force_directions.T @ self.inverse_mass.times(self.force_directions @ impulses)
        return product

    def labelled_arrays(self) -> list[tuple[str, np.ndarray[Any, Any]]]:
        """Return the labelled arrays that define W and M⁻¹."""
        return [*sparse_arrays("W", self.force_directions), *sparse_arrays("Minv", self.inverse_mass.matrix)]

    def fresh(self) -> "Factors":
        """Return equal factors that share no memory with these."""
        motion = None if self.free_motion is None else frozen(self.free_motion, np.float64)
        return Factors(self.directions.copy(), self.inverse_mass.fresh(), motion)


@lru_cache(maxsize=16)
def _diagonal_pattern(n_dofs: int) -> sp.csr_array[Any]:
    """Return an identity matrix whose index arrays are reused."""
    index = np.arange(n_dofs + 1, dtype=np.int32)
    matrix = sp.csr_array((np.ones(n_dofs), index[:-1], index), shape=(n_dofs, n_dofs))
    matrix.has_canonical_format = True
    return matrix


def _read_square(values: Any, name: str) -> sp.csr_array[Any]:
    """Return a matrix as ``read_matrix`` does; raise ``ProblemError`` if it is not square."""
    source = as_matrix(values, name)
    if source.shape[0] != source.shape[1]:
        raise ProblemError(f"{name} must be square, got {source.shape}.")
    matrix: sp.csr_array[Any] = read_matrix(source, name, sp.csr_array)
    return matrix


def _count_products(root_indptr, root_indices, root_data, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return the number of products that ``multiply_by_root`` sums."""
    return int(np.diff(root_indptr)[indices].sum())


@partial(interpretable, count=_count_products)
@njit(cache=True, error_model="numpy")
def multiply_by_root(root_indptr, root_indices, root_data, indptr, indices, data):  # type: ignore[no-untyped-def]
    """Return entries, ascending rows and starts of the columns of Sᵀ W, for S in CSR and W in CSC."""
    n_dofs, n_columns = len(root_indptr) - 1, len(indptr) - 1
    capacity = 0
    for p in range(len(indices)):
        capacity += root_indptr[indices[p] + 1] - root_indptr[indices[p]]
    values, rows = np.empty(capacity), np.empty(capacity, dtype=np.int32)
    starts = np.zeros(n_columns + 1, dtype=np.int32)
    sums, last_column, touched = np.zeros(n_dofs), np.full(n_dofs, -1, dtype=np.int64), np.empty(n_dofs, dtype=np.int64)
    end = 0
    for column in range(n_columns):
        count = 0
        for p in range(indptr[column], indptr[column + 1]):
            for q in range(root_indptr[indices[p]], root_indptr[indices[p] + 1]):
                row = root_indices[q]
                if last_column[row] != column:
                    last_column[row], sums[row], k = column, 0.0, count
                    while k > 0 and touched[k - 1] > row:
                        touched[k] = touched[k - 1]
                        k -= 1
                    touched[k] = row
                    count += 1
                sums[row] += data[p] * root_data[q]
        for k in range(count):
            if sums[touched[k]] != 0.0:
                rows[end], values[end] = touched[k], sums[touched[k]]
                end += 1
        starts[column + 1] = end
    return values[:end], rows[:end], starts
