"""Errors of measuring and showing."""

from pathlib import Path

from ..problems.errors import ProxbenchError


class BenchError(ProxbenchError):
    """A run, its options or its files do not hold together."""


class InterruptedRunError(ProxbenchError):
    """A run was interrupted from outside; what was finished is kept.

    Attributes:
        run_dir: the folder of the run, from which it can be resumed.
    """

    def __init__(self, run_dir: Path) -> None:
        super().__init__(f"interrupted; finished cases are kept, go on with: proxbench run --resume {run_dir}")
        self.run_dir = run_dir
