"""What the command line asks of a simulation or a study."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Request:
    """What the command line asks for.

    Attributes:
        scene: its name, empty if none is named.
        options: options of the scene that were given; None switches one off.
        numbers: what of a plan was given: step_size, stepper, solver, tolerance, max_iterations.
        duration: simulated time [s].
        output: result file, or the folder for it.
        force: replace files that exist.
        resume: result file to go on with.
        record: recording to write.
        chart: chart to write; None for where charts of the kind are written, if they are.
    """

    scene: str
    options: Mapping[str, Any]
    numbers: Mapping[str, Any]
    duration: float | None
    output: Path
    force: bool
    resume: Path | None
    record: Path | None
    chart: Path | None

    @property
    def given(self) -> dict[str, Any]:
        """What a stored simulation that goes on is held against: the scene, if one is named, numbers and options."""
        return {**({"scene": self.scene} if self.scene else {}), **self.numbers, **self.options}
