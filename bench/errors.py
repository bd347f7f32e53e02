"""Errors of measuring and showing."""

from pathlib import Path

from ..problems.errors import ProxbenchError


class BenchError(ProxbenchError):
    """A run, its options or its files do not hold together."""


class FailedSimulationError(BenchError):
    """A step of a simulation failed; the steps before it are kept."""


class InterruptedWorkError(ProxbenchError):
    """Something was interrupted from outside; what was finished is kept."""


class InterruptedRunError(InterruptedWorkError):
    """A run was interrupted from outside; what was finished is kept.

    Attributes:
        run_dir: the folder of the run, from which it can be resumed.
    """

    def __init__(self, run_dir: Path) -> None:
        super().__init__(f"interrupted; finished cases are kept, go on with: proxbench run --resume {run_dir}")
        self.run_dir = run_dir


class InterruptedSimulationError(InterruptedWorkError):
    """A simulation was interrupted from outside; the steps taken are kept.

    Attributes:
        file: its result file, from which it can be resumed.
    """

    def __init__(self, file: Path) -> None:
        super().__init__(f"interrupted; the steps taken are kept, go on with: proxbench simulate --resume {file}")
        self.file = file
