"""The labels of the table of threads."""

import pytest
from proxbench.problems import load
from proxbench.solvers.prox.parallel import coloured_sweep, slabs
from proxbench.solvers.sweeps.step_size import diagonal_step_sizes
from threads import slab_sweeps


def test_labels_contain_the_threads_that_run(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = load("funnel-300")
    sizes = diagonal_step_sizes(problem, 1.1)
    assert [*slab_sweeps(problem, sizes, (1, 2))] == ["by slabs, threads=1", "by slabs, threads=1 (of 2)"]
    monkeypatch.setattr(coloured_sweep, "MIN_CONTACTS_PER_THREAD", 1)
    monkeypatch.setattr(coloured_sweep, "MIN_EFFICIENCY", 0.0)
    monkeypatch.setattr(slabs, "MIN_SLAB", 8)
    assert [*slab_sweeps(problem, sizes, (1, 2))] == ["by slabs, threads=1", "by slabs, threads=2"]
