"""Projected iterations on a GPU, with Warp kernels: two methods that differ in the order of contacts.

    WarpJORprox             all contacts from the same iterate
    WarpColouredSORprox     colour by colour, where contacts of one colour share no movable body

The device is always part of the name. With ``device="cpu"`` the same kernels run on the processor, in one thread.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, ClassVar

from ...problems.arrays import FloatArray
from ...problems.contact.problem import ContactProblem
from ...problems.contact.residual import Residual
from ...problems.contact.solver import Observer, Solution, SolverError, Stop
from ..iteration.loop import PreparedIteration
from ..iteration.method import SLIDING, Method
from ..peers.installed import check_installed
from ..sweeps.step_size import check_relaxation, diagonal_step_sizes
from .parallel.pairs import unsupported_reason
from .parallel.warp_sweeps import ColouredDeviceSweep, DeviceIterates, DeviceSweep, JacobiDeviceSweep, find_device


@dataclass(frozen=True)
class PreparedOnDevice:
    """A projected iteration whose data are on a device."""

    iteration: PreparedIteration
    sweep: DeviceSweep

    def solve(self, stop: Stop, start: FloatArray | None = None, observe: Observer | None = None) -> Solution:
        """Sweep on the device until the residual reaches the tolerance.

        The message of the solution reports the transfer times.
        """
        seconds_before = self.sweep.transfer_seconds
        solution = self.iteration.solve(stop, start, observe)
        self.synchronise()
        iterate_transfer_ms = 1e3 * (self.sweep.transfer_seconds - seconds_before)
        data_transfer_ms = 1e3 * self.sweep.upload_seconds
        transfers = (
            f"on {self.sweep.device}, transfers: {data_transfer_ms:.3g} ms for the data, "
            f"{iterate_transfer_ms:.3g} ms for iterates"
        )
        return replace(solution, message="; ".join(filter(None, [solution.message, transfers])))

    def synchronise(self) -> None:
        """Wait for the device."""
        self.sweep.synchronise()


@dataclass(frozen=True)
class DeviceMethod(Method, ABC):
    """A projected iteration on a Warp device."""

    relaxation: float = 1.0
    device: str = "cuda"

    law_kinds: ClassVar[frozenset[int]] = SLIDING

    def __post_init__(self) -> None:
        check_relaxation(self.relaxation)
        name = type(self).__name__
        check_installed(name, "warp", "gpu")
        if not isinstance(self.device, str):
            raise SolverError(f"device must be a string such as 'cuda', 'cuda:1' or 'cpu', got {self.device!r}.")
        find_device(name, self.device)

    @property
    def name(self) -> str:
        """Class name with the options that differ from the defaults, and the device."""
        options = f"relaxation={self.relaxation!r}, " if self.relaxation != 1.0 else ""
        return f"{type(self).__name__}({options}device={self.device!r})"

    @abstractmethod
    def move_to_device(self, problem: ContactProblem, step_sizes: FloatArray, device: Any) -> DeviceSweep:
        """Return the sweep with its data on the device."""

    def supports(self, problem: ContactProblem) -> str | None:
        """Return why the solver cannot solve ``problem``, or None."""
        return super().supports(problem) or unsupported_reason(problem)

    def prepare(self, problem: ContactProblem) -> PreparedOnDevice:
        """Copy the data to the device."""
        self.check_supports(problem)
        device = find_device(type(self).__name__, self.device)
        sweep = self.move_to_device(problem, diagonal_step_sizes(problem, self.relaxation), device)
        return PreparedOnDevice(PreparedIteration(problem, Residual(problem), partial(DeviceIterates, sweep)), sweep)


@dataclass(frozen=True)
class WarpJORprox(DeviceMethod):
    """Projected Jacobi over-relaxation on a Warp device, as ``JORprox``.

    Attributes:
        relaxation: ω; problems with many contacts need values well below 1.
        device: "cuda" for the first GPU, "cuda:1" for another, or "cpu".

    Raises:
        SolverError: if Warp is not installed, there is no such device, or ω is out of range.
    """

    def move_to_device(self, problem: ContactProblem, step_sizes: FloatArray, device: Any) -> DeviceSweep:
        """Return Jacobi sweeps."""
        return JacobiDeviceSweep(problem, step_sizes, device)


@dataclass(frozen=True)
class WarpColouredSORprox(DeviceMethod):
    """Projected Gauss–Seidel colour by colour on a Warp device.

    Attributes:
        relaxation: ω, as in ``SORprox``.
        device: "cuda" for the first GPU, "cuda:1" for another, or "cpu".

    Raises:
        SolverError: if Warp is not installed, there is no such device, or ω is out of range.
    """

    def move_to_device(self, problem: ContactProblem, step_sizes: FloatArray, device: Any) -> DeviceSweep:
        """Return sweeps by colour."""
        return ColouredDeviceSweep(problem, step_sizes, device)
