"""Sweeps on a Warp device: a GPU (CUDA), or the processor itself.

The data are copied to the device once, in ``prepare``. A window of sweeps is a sequence of kernels. For a GPU,
it is recorded once for each length, and then started by one call (a CUDA graph). Before each check of the
residual, Λ and ξ are copied back. The copy waits for the device, so the time of a solve includes all kernels.
``upload_seconds`` and ``transfer_seconds`` count copies to and from the device and the allocation of its memory, which
``transfer_seconds`` includes once for each start. They include neither kernels, nor the recording of graphs, nor
computations on the host.
"""

import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....problems.arrays import FloatArray
from ....problems.contact.problem import ContactProblem
from ....problems.contact.solver import SolverError
from ....problems.errors import InsufficientMemoryError
from ...sweeps.factors import own_coupling
from .colouring import colour_contacts
from .pairs import in_pairs


def find_device(solver: str, name: str) -> Any:
    """Return a Warp device by its name; ``solver`` is the name of the solver in messages.

    Raises:
        SolverError: if there is no such device.
    """
    import warp as wp

    wp.config.log_level = wp.LOG_ERROR
    if name != "cpu" and not wp.is_cuda_available():
        raise SolverError(f"{solver} needs a GPU for device={name!r}, and there is none; use device='cpu'.")
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError):
        known = ", ".join(repr(str(device)) for device in wp.get_devices())
        raise SolverError(
            f"{solver} does not find the device {name!r}; the devices of this machine are {known}."
        ) from None


class DeviceSweep(ABC):
    """The data of a problem on a device.

    Args:
        problem: a problem with factors whose contacts touch at most two bodies each.
        step_sizes: the step sizes [kg] of ``step_size``, shape (n_blocks, 2).
        device: the device.

    Attributes:
        layout: the padded blocks.
        pieces: W̃ in pairs of pieces, of width 3.
        device: the device.
        kernels: the module of the kernels, imported at first use.
        contacts: the constant data of all contacts, see ``warp_kernels.Contacts``.
        upload_seconds: wall time of copying the data to the device, with the allocation of its memory [s].
        transfer_seconds: wall time of copying Λ, ξ and v to and from the device, with the allocation of their memory,
            in all solves [s].

    Raises:
        InsufficientMemoryError: if the memory of the device does not suffice.
    """

    def __init__(self, problem: ContactProblem, step_sizes: FloatArray, device: Any) -> None:
        import warp as wp

        from . import warp_kernels

        wp.load_module(warp_kernels, device=device)  # compiled here, because recording a graph cannot load it
        self.kernels, self.device, self.transfer_seconds = warp_kernels, device, 0.0
        self.layout, self.pieces = problem.layout, in_pairs(problem.factor_pieces())
        pieces, layout = self.pieces, self.layout
        free_velocity = np.zeros((layout.n_blocks, 3))
        free_velocity[:, : layout.width] = layout.pad(problem.free_velocity)
        values, coupling = pieces.values, self.coupling()  # deferred values are computed here, before timing
        friction, fixed_bound = layout.friction_coefficient, layout.fixed_bound
        self.find_order()
        contacts = warp_kernels.Contacts()
        contacts.length, contacts.idle = pieces.length, pieces.n_chunks
        self.synchronise()
        start_time = time.perf_counter()
        contacts.bodies, contacts.pieces = self.copy_indices(pieces.chunks), self.copy_numbers(values)
        contacts.free_velocity, contacts.step_sizes = self.copy_numbers(free_velocity), self.copy_numbers(step_sizes)
        contacts.friction, contacts.fixed_bound = self.copy_numbers(friction), self.copy_numbers(fixed_bound)
        contacts.coupling = self.copy_numbers(coupling)
        self.contacts = contacts
        self.copy_order()
        self.synchronise()
        self.upload_seconds = time.perf_counter() - start_time

    @abstractmethod
    def coupling(self) -> FloatArray:
        """Return the correction of ξ_T after a change of Λ_N, shape (n_blocks, 2)."""

    @abstractmethod
    def find_order(self) -> None:
        """Find the order in which contacts are updated."""

    @abstractmethod
    def copy_order(self) -> None:
        """Copy the order to the device."""

    @abstractmethod
    def launch_sweep(self, impulses: Any, velocity: Any) -> None:
        """Start the kernels of one sweep."""

    def copy_numbers(self, values: FloatArray) -> Any:
        """Return a copy of numbers on the device, flat."""
        import warp as wp

        return self._copy(np.ascontiguousarray(values, dtype=np.float64), wp.float64)

    def copy_indices(self, values: Any) -> Any:
        """Return a copy of indices on the device, flat."""
        import warp as wp

        return self._copy(np.ascontiguousarray(values, dtype=np.int32), wp.int32)

    def _copy(self, values: NDArray[Any], dtype: Any) -> Any:
        """Return a flat copy on the device.

        Raises:
            InsufficientMemoryError: if the memory of the device does not suffice.
        """
        import warp as wp

        try:
            return wp.array(values.reshape(-1), dtype=dtype, device=self.device)
        except RuntimeError as error:
            if "allocate" not in str(error):
                raise
            raise InsufficientMemoryError(
                f"the memory of {self.device} does not suffice for {self.layout.n_blocks:,} contacts; solve a smaller "
                "problem, or use a solver without a device."
            ) from error

    def launch(self, kernel: Any, n_threads: int, *arguments: Any) -> None:
        """Start a kernel."""
        import warp as wp

        wp.launch(kernel, dim=n_threads, inputs=[self.contacts, *arguments], device=self.device)

    def synchronise(self) -> None:
        """Wait for the device."""
        import warp as wp

        wp.synchronize_device(self.device)


class ColouredDeviceSweep(DeviceSweep):
    """Gauss–Seidel sweeps colour by colour: one kernel for each colour."""

    def coupling(self) -> FloatArray:
        """Return G_T1N and G_T2N."""
        coupling: FloatArray = own_coupling(self.pieces.starts, self.pieces.values)
        return coupling

    def find_order(self) -> None:
        """Sort the contacts by colour."""
        colours, n_colours = colour_contacts(self.pieces)
        self._contacts_by_colour = np.argsort(colours, kind="stable")
        self._colour_sizes = np.bincount(colours, minlength=n_colours).tolist()

    def copy_order(self) -> None:
        """Copy the contacts sorted by colour."""
        self._order = self.copy_indices(self._contacts_by_colour)

    def launch_sweep(self, impulses: Any, velocity: Any) -> None:
        """Start the kernels of all colours."""
        first = 0
        for size in self._colour_sizes:
            self.launch(self.kernels.update_colour, size, self._order, first, impulses, velocity)
            first += size


class JacobiDeviceSweep(DeviceSweep):
    """Jacobi sweeps: one kernel for all contacts, and one for all bodies."""

    def coupling(self) -> FloatArray:
        """Return zeros, because ξ is that of the previous sweep."""
        return np.zeros((self.layout.n_blocks, 2))

    def find_order(self) -> None:
        """List the pieces of each body."""
        chunks, n_bodies = self.pieces.chunks, self.pieces.n_chunks
        counts = np.bincount(chunks, minlength=n_bodies + 1)[:n_bodies]
        starts = np.concatenate([[0], np.cumsum(counts)])
        self._pieces_of_bodies = starts, np.argsort(chunks, kind="stable")[: starts[-1]]

    def copy_order(self) -> None:
        """Copy the list of each body, and allocate the changes of Λ."""
        self._starts, self._touching = map(self.copy_indices, self._pieces_of_bodies)
        self._changes = self.copy_numbers(np.zeros(3 * self.layout.n_blocks))

    def launch_sweep(self, impulses: Any, velocity: Any) -> None:
        """Start both kernels."""
        n_blocks, n_bodies = self.layout.n_blocks, self.pieces.n_chunks
        self.launch(self.kernels.update_all, n_blocks, impulses, velocity, self._changes)
        self.launch(self.kernels.update_velocities, n_bodies, self._starts, self._touching, self._changes, velocity)


class DeviceIterates:
    """Λ, three entries for each contact, and v of an iteration from ``start``, shape (n_rows,), on a device."""

    def __init__(self, sweep: DeviceSweep, start: FloatArray) -> None:
        layout, pieces = sweep.layout, sweep.pieces
        padded = np.zeros((layout.n_blocks, 3))
        padded[:, : layout.width] = layout.pad(start)
        velocity = np.append(pieces.times(padded), np.zeros(pieces.length))
        sweep.synchronise()
        start_time = time.perf_counter()
        self._impulses, self._velocity = sweep.copy_numbers(padded), sweep.copy_numbers(velocity)
        self._relative_velocity = sweep.copy_numbers(np.zeros(padded.size))
        sweep.synchronise()
        sweep.transfer_seconds += time.perf_counter() - start_time
        self._sweep = sweep
        self._graphs: dict[int, Any] = {}

    def sweep(self, count: int) -> None:
        """Do ``count`` sweeps: on a GPU as one recorded graph."""
        if not self._sweep.device.is_cuda:
            self._launch(count)
            return
        import warp as wp

        if count not in self._graphs:
            with wp.ScopedCapture(device=self._sweep.device) as capture:
                self._launch(count)
            self._graphs[count] = capture.graph
        wp.capture_launch(self._graphs[count])

    def impulses(self) -> FloatArray:
        """Return Λ over rows."""
        return self._sweep.layout.unpad(self._lanes(self._impulses))

    def relative_velocity(self) -> FloatArray:
        """Return ξ over rows."""
        sweep = self._sweep
        sweep.launch(
            sweep.kernels.write_relative_velocity, sweep.layout.n_blocks, self._velocity, self._relative_velocity
        )
        return sweep.layout.rows_of(self._lanes(self._relative_velocity))

    def _launch(self, count: int) -> None:
        for _ in range(count):
            self._sweep.launch_sweep(self._impulses, self._velocity)

    def _lanes(self, values: Any) -> FloatArray:
        """Return numbers of the device in padded lanes, flat; only the copy counts as transfer."""
        self._sweep.synchronise()
        start_time = time.perf_counter()
        lanes: FloatArray = values.numpy().reshape(-1, 3)
        self._sweep.transfer_seconds += time.perf_counter() - start_time
        return np.ascontiguousarray(lanes[:, : self._sweep.layout.width]).reshape(-1)
