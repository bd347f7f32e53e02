"""Recording a simulation while it runs."""

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from .running import OnStep
from .simulation import Simulation


@contextlib.contextmanager
def recorded(simulation: Simulation, file: Path | None, force: bool) -> Iterator[Sequence[OnStep]]:
    """Yield what has to be called after every step to record it into ``file``: nothing if that is None.

    The recording begins at the present state, and is kept if the simulation is stopped before its end.

    Raises:
        BenchError: if the file exists (without ``force``) or cannot be written, before the first step.
    """
    if file is None:
        yield ()
        return
    from ..recordings.scenes import scene_recorder  # rerun takes a second to import

    left = simulation.plan.n_steps - simulation.n_steps
    with scene_recorder(simulation.plan.scene, file, left, force) as recorder:
        recorder.start(simulation.state)
        yield (lambda number, step: recorder(step),)
