"""The factors of a Delassus matrix: force directions W and inverse mass M⁻¹, with G = Wᵀ M⁻¹ W."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit
from numpy.typing import ArrayLike
from scipy.sparse.csgraph import connected_components

from ..arrays import FloatArray, IntArray, frozen, read_only
from ..errors import ProblemError
from .blocks import BlockLayout
from .pieces import Pieces, cut_into_pieces

BLOCK_SYMMETRY = 1e-12
"""Largest |A − Aᵀ| relative to the largest |A| in a block of M or M⁻¹ that passes as rounding."""

MOST_ENTRIES = 20_000_000
"""Entries that the inverse of a mass matrix may have, 160 MB of numbers."""


@dataclass(frozen=True, eq=False)
class InverseMass:
    """M⁻¹ with its root, which is computed once for all problems that share the object.

    Attributes:
        matrix: M⁻¹, symmetric positive definite and block diagonal, shape (n_dofs, n_dofs), scipy CSR.
        mass: M, where M⁻¹ was computed from it, scipy CSR; ``None`` where M⁻¹ was given.
    """

    matrix: sp.csr_array[Any]
    mass: sp.csr_array[Any] | None = None
    _root_blocks: dict[int, FloatArray | None] = field(default_factory=dict, init=False, repr=False)

    @staticmethod
    def create(given: Any) -> "InverseMass":
        """Return a checked, read-only M⁻¹ from its diagonal, or from a matrix, dense or sparse.

        Raises:
            ProblemError: on a wrong shape, a number that is not finite, or an M⁻¹ that is not positive definite.
        """
        if np.ndim(given) == 1 and not sp.issparse(given):
            diagonal = frozen(given, np.float64, "M⁻¹")
            index = np.arange(len(diagonal) + 1, dtype=np.int32)
            matrix = sp.csr_array((diagonal, index[:-1], index), shape=(len(diagonal),) * 2)
        else:
            matrix = sp.csr_array(as_sparse_input(given, "M⁻¹"), dtype=np.float64, copy=True)
        _check_square(matrix, "M⁻¹")
        inverse = InverseMass(matrix)
        inverse.check()
        return inverse

    @staticmethod
    def of_mass(given: Any) -> "InverseMass":
        """Return M⁻¹ computed from M, body by body, and keep M with it.

        Args:
            given: M, symmetric positive definite, dense or scipy sparse, shape (n_dofs, n_dofs). Its blocks are the
                connected components of its nonzero entries, in whatever order the degrees of freedom stand.

        Raises:
            ProblemError: on a wrong shape, a number that is not finite, an M that is not symmetric positive definite,
                or one whose inverse would have more than ``MOST_ENTRIES`` entries.
        """
        mass = sp.csr_array(as_sparse_input(given, "M"), dtype=np.float64, copy=True)
        _check_square(mass, "M")
        matrix = _block_inverse(mass)
        check_finite(matrix, "M⁻¹")
        inverse = InverseMass(matrix, mass)
        inverse.check()
        return inverse

    def check(self) -> None:
        """Raise ``ProblemError`` unless M⁻¹ is positive definite."""
        _ = self.root_diagonal if self.is_diagonal else self.root

    @cached_property
    def is_diagonal(self) -> bool:
        """Whether M⁻¹ has no entries off its diagonal."""
        matrix = self.matrix
        return len(matrix.data) == matrix.shape[0] and _counts_up(matrix.indices)

    @cached_property
    def root_diagonal(self) -> FloatArray:
        """The diagonal of S, shape (n_dofs,), where M⁻¹ is diagonal."""
        diagonal = self.matrix.data
        if (diagonal <= 0).any():
            dof = int(np.argmax(diagonal <= 0))
            raise ProblemError(f"M⁻¹[{dof}, {dof}] = {diagonal[dof]} must be positive.")
        root: FloatArray = np.sqrt(diagonal)
        return root

    @cached_property
    def root(self) -> sp.csr_array[Any]:
        """S with M⁻¹ = S Sᵀ, of the same blocks as M⁻¹, shape (n_dofs, n_dofs)."""
        if not self.is_diagonal:
            return _block_cholesky(self.matrix)
        return sp.csr_array((self.root_diagonal, self.matrix.indices, self.matrix.indptr), shape=self.matrix.shape)

    def times(self, vector: FloatArray) -> FloatArray:
        """Return M⁻¹ x, shape (n_dofs,)."""
        product: FloatArray = self.matrix.data * vector if self.is_diagonal else self.matrix @ vector
        return product

    def root_times(self, vector: FloatArray) -> FloatArray:
        """Return S x, M⁻¹ = S Sᵀ, shape (n_dofs,)."""
        product: FloatArray = self.root_diagonal * vector if self.is_diagonal else self.root @ vector
        return product

    def fresh(self) -> "InverseMass":
        """Return the same numbers in memory of their own."""
        return InverseMass(self.matrix.copy(), None if self.mass is None else self.mass.copy())

    def root_blocks(self, length: int) -> FloatArray | None:
        """Return S in diagonal blocks of ``length``, as ``Pieces.scaled`` takes them, None if it has other entries."""
        if length not in self._root_blocks:
            self._root_blocks[length] = self._cut_root(length)
        return self._root_blocks[length]

    def _cut_root(self, length: int) -> FloatArray | None:
        n_dofs = self.matrix.shape[0]
        if n_dofs % length:
            return None
        if self.is_diagonal:
            return frozen(self.root_diagonal, np.float64)
        blocks = sp.bsr_array(self.root, blocksize=(length, length))
        is_blocked = np.array_equal(blocks.indices, np.arange(n_dofs // length))
        return frozen(blocks.data, np.float64) if is_blocked else None


@dataclass(frozen=True, eq=False)
class Factors:
    """W, M⁻¹ and the free motion of the system that a problem comes from; build it with ``create``.

    Attributes:
        directions: W as given: scipy CSC, shape (n_dofs, n_rows), or in pieces, one block a contact.
        inverse_mass: M⁻¹.
        free_motion: u_B + M⁻¹ h Δt, the velocity the system would have without contacts, shape (n_dofs,), or ``None``.
    """

    directions: sp.csc_array[Any] | Pieces
    inverse_mass: InverseMass
    free_motion: FloatArray | None = None

    @staticmethod
    def create(force_directions: Any, inverse_mass: Any, free_motion: ArrayLike | None = None) -> "Factors":
        """Return checked, read-only factors; see ``ContactProblem.from_factors`` for the arguments.

        Raises:
            ProblemError: on a wrong shape, a number that is not finite, or an M⁻¹ that is not positive definite.
        """
        directions = sp.csc_array(as_sparse_input(force_directions, "W"), dtype=np.float64, copy=True)
        directions.sum_duplicates()
        check_finite(directions, "W")
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
        given = self.directions
        return given.n_blocks * given.width if isinstance(given, Pieces) else int(given.shape[1])

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
        given = self.directions
        if isinstance(given, Pieces) and given.width == layout.width and layout.is_dense:
            blocks = self.inverse_mass.root_blocks(given.length)
            if blocks is not None:
                return given.scaled(blocks)
        if self.inverse_mass.is_diagonal:
            return cut_into_pieces(self.force_directions, self.inverse_mass.root_diagonal, layout)
        return cut_into_pieces(self.scaled_directions, np.ones(self.n_dofs), layout)

    @cached_property
    def scaled_directions(self) -> sp.csc_array[Any]:
        """W̃ = Sᵀ W, so that G = W̃ᵀ W̃, shape (n_dofs, n_rows), columns sorted."""
        directions, inverse = self.force_directions, self.inverse_mass
        if inverse.is_diagonal:
            values = directions.data * inverse.root_diagonal[directions.indices]
            return sp.csc_array((values, directions.indices, directions.indptr), shape=directions.shape)
        scaled = sp.csc_array(inverse.root.T @ directions)
        scaled.sort_indices()
        return scaled

    def delassus_times(self, impulses: FloatArray) -> FloatArray:
        """Return Wᵀ M⁻¹ W Λ [m/s], shape (n_rows,)."""
        if isinstance(self.directions, Pieces):
            return self.directions.transposed_times(self.inverse_mass.times(self.directions.times(impulses)))
        product: FloatArray = self.force_directions.T @ self.inverse_mass.times(self.force_directions @ impulses)
        return product

    def numbers(self) -> list[tuple[str, np.ndarray[Any, Any]]]:
        """Return the labelled arrays that define W and M⁻¹."""
        return [*sparse_numbers("W", self.force_directions), *sparse_numbers("Minv", self.inverse_mass.matrix)]

    def fresh(self) -> "Factors":
        """Return equal factors that share no memory with these."""
        motion = None if self.free_motion is None else frozen(self.free_motion, np.float64)
        return Factors(self.directions.copy(), self.inverse_mass.fresh(), motion)


def as_sparse_input(given: Any, name: str) -> Any:
    """Return ``given`` if it is a sparse matrix, else as a dense one of numbers.

    Raises:
        ProblemError: if it is neither.
    """
    try:
        matrix: Any = given if sp.issparse(given) else np.asarray(given)
        if matrix.ndim == 2 and matrix.dtype.kind in "fiub":
            return matrix
    except (TypeError, ValueError):
        pass
    raise ProblemError(f"{name} must be a matrix of real numbers, dense or scipy sparse, got {type(given).__name__}.")


def check_finite(matrix: Any, name: str) -> None:
    """Look at the entries of a CSR or CSC matrix, and make its arrays read-only.

    Raises:
        ProblemError: that names the first entry which is not finite.
    """
    if not np.isfinite(matrix.data).all():
        entries = matrix.tocoo()
        at = int(np.argmin(np.isfinite(entries.data)))
        raise ProblemError(f"{name}[{entries.row[at]}, {entries.col[at]}] = {entries.data[at]} must be finite.")
    read_only(matrix.data, matrix.indices, matrix.indptr)


def sparse_numbers(label: str, matrix: Any) -> list[tuple[str, np.ndarray[Any, Any]]]:
    """Return the labelled arrays of a canonical CSR or CSC matrix, with index types that do not depend on its size."""
    indices, starts = matrix.indices.astype(np.int64), matrix.indptr.astype(np.int64)
    return [(label, matrix.data), (f"{label}.indices", indices), (f"{label}.indptr", starts)]


def _diagonal_blocks(matrix: sp.csr_array[Any]) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield the blocks of a block diagonal matrix, connected components of its pattern, those of a size together.

    Each time the degrees of freedom, shape (n_blocks, size), and the blocks, shape (n_blocks, size, size).
    """
    count, label = connected_components(matrix, directed=False)
    sizes = np.bincount(label, minlength=count)
    order, starts = np.argsort(label, kind="stable"), np.cumsum(sizes) - sizes
    place = np.empty(len(label), dtype=np.int64)
    place[order] = np.arange(len(label)) - starts[label[order]]
    entries = matrix.tocoo()
    block_of_entry = label[entries.row]
    number = np.empty(count, dtype=np.int64)
    for size in np.unique(sizes):
        members = np.flatnonzero(sizes == size)
        number[members] = np.arange(len(members))
        chosen = sizes[block_of_entry] == size
        blocks = np.zeros((len(members), size, size))
        at = number[block_of_entry[chosen]], place[entries.row[chosen]], place[entries.col[chosen]]
        blocks[at] = entries.data[chosen]
        yield order[starts[members, None] + np.arange(size)], blocks


def _block_roots(dofs: IntArray, blocks: FloatArray, name: str) -> FloatArray:
    """Return the Cholesky factors of symmetric positive definite blocks; raise ``ProblemError`` for any other."""
    skew = np.abs(blocks - blocks.transpose(0, 2, 1)).max(axis=(1, 2))
    crooked = skew > BLOCK_SYMMETRY * np.abs(blocks).max(axis=(1, 2))
    if crooked.any():
        first = dofs[int(np.argmax(crooked)), 0]
        raise ProblemError(f"{name} must be symmetric; the block of degree of freedom {first} is not.")
    try:
        return np.asarray(np.linalg.cholesky(blocks), dtype=np.float64)
    except np.linalg.LinAlgError:
        first = dofs[int(np.argmin(np.linalg.eigvalsh(blocks)[:, 0])), 0]
        raise ProblemError(
            f"{name} must be positive definite; the block of degree of freedom {first} is not."
        ) from None


def _from_blocks(parts: list[tuple[IntArray, FloatArray]], n_dofs: int) -> sp.csr_array[Any]:
    """Return the matrix that has these blocks, as ``_diagonal_blocks`` yields them; zeros are not stored."""
    rows, columns, values = [], [], []
    for dofs, blocks in parts:
        block, i, j = np.nonzero(blocks)
        rows.append(dofs[block, i])
        columns.append(dofs[block, j])
        values.append(blocks[block, i, j])
    if not parts:
        return sp.csr_array((n_dofs, n_dofs))
    indices = (np.concatenate(rows), np.concatenate(columns))
    matrix = sp.csr_array((np.concatenate(values), indices), shape=(n_dofs, n_dofs))
    matrix.sort_indices()
    return matrix


def _block_cholesky(matrix: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return S with S Sᵀ = matrix, computed block by block."""
    roots = [(dofs, _block_roots(dofs, blocks, "M⁻¹")) for dofs, blocks in _diagonal_blocks(matrix)]
    return _from_blocks(roots, matrix.shape[0])


def _check_square(matrix: sp.csr_array[Any], name: str) -> None:
    """Add up duplicates, and raise ``ProblemError`` for a matrix that is not square or has a number not finite."""
    if matrix.shape[0] != matrix.shape[1]:
        raise ProblemError(f"{name} must be square, got {matrix.shape}.")
    matrix.sum_duplicates()
    check_finite(matrix, name)


def _block_inverse(mass: sp.csr_array[Any]) -> sp.csr_array[Any]:
    """Return M⁻¹, computed block by block and symmetric to the last bit."""
    pattern = mass.copy()
    pattern.eliminate_zeros()
    sizes = np.bincount(connected_components(pattern, directed=False)[1])
    if int((sizes.astype(np.int64) ** 2).sum()) > MOST_ENTRIES:
        raise ProblemError(
            f"M couples {int(sizes.max())} degrees of freedom with each other, and its inverse would have more than "
            f"{MOST_ENTRIES} entries; give the problem by its Delassus matrix."
        )
    inverses = []
    for dofs, blocks in _diagonal_blocks(pattern):
        _block_roots(dofs, blocks, "M")
        inverse = np.linalg.inv(blocks)
        inverses.append((dofs, 0.5 * (inverse + inverse.transpose(0, 2, 1))))
    return _from_blocks(inverses, mass.shape[0])


@njit(cache=True)
def _counts_up(indices):  # type: ignore[no-untyped-def]
    """Whether the indices are the natural numbers from 0."""
    count = 0
    while count < len(indices) and indices[count] == count:
        count += 1
    return count == len(indices)
