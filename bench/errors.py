"""Exceptions of ``bench``."""

from pathlib import Path
from shlex import quote

from ..problems.errors import ProxbenchError


class BenchError(ProxbenchError):
    """A run, its options or its files are invalid."""


class UnwritableError(BenchError):
    """A file cannot be written; its content can still be printed."""


class FailedSimulationError(BenchError):
    """A step of a simulation failed; the steps before it are kept."""


class InterruptedWorkError(ProxbenchError):
    """A run or simulation was interrupted; finished work is kept."""


class InterruptedRunError(InterruptedWorkError):
    """A run was interrupted; its measurements are kept.

    Attributes:
        run_dir: the folder of the run, from which the run can be resumed.
    """

    def __init__(self, run_dir: Path) -> None:
        measured = any((run_dir / "cases").glob("*.json"))
        kept = "; measurements are kept;" if measured else " before anything was measured;"
        super().__init__(f"interrupted{kept} resume with: proxbench run --resume {quote(str(run_dir))}")
        self.run_dir = run_dir


class InterruptedSimulationError(InterruptedWorkError):
    """A simulation was interrupted; its steps are kept.

    Attributes:
        file: the result file, from which the simulation can be resumed.
    """

    def __init__(self, file: Path) -> None:
        super().__init__(
            f"interrupted; the steps taken are kept; resume with: proxbench simulate --resume {quote(str(file))}"
        )
        self.file = file
