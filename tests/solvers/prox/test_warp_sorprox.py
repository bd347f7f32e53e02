"""Warp's kernels give the same sweeps as the compiled kernels; here they run on the processor."""

import numpy as np
import pytest
from proxbench.problems import ContactProblem, judge, load
from proxbench.problems.contact.transformations import permuted
from proxbench.problems.errors import InsufficientMemoryError
from proxbench.solvers import SolverError, Status, Stop, create, solve
from proxbench.solvers.prox.parallel.colouring import colour_contacts
from proxbench.solvers.prox.parallel.pairs import in_pairs

warp = pytest.importorskip("warp", reason="the extra gpu is not installed")

PROBLEMS = ["funnel-100", "funnel-planar-100", "funnel-frictionless-100", "bodies-stack-10"]


def iterates(solver: str, problem: ContactProblem, count: int = 20) -> np.ndarray:
    seen: list[np.ndarray] = []
    create(solver).prepare(problem).solve(Stop(1e-300, count), observe=lambda _, x: seen.append(x.copy()))
    return np.array(seen)


@pytest.mark.parametrize("name", PROBLEMS)
def test_jacobi_sweeps_are_those_of_jorprox(name: str) -> None:
    problem = load(name)
    found = iterates("WarpJORprox(relaxation=0.3, device='cpu')", problem)
    expected = iterates("JORprox(relaxation=0.3)", problem)
    assert np.abs(found - expected).max() <= 1e-12 * np.abs(expected).max()


@pytest.mark.parametrize("name", PROBLEMS)
def test_coloured_sweeps_are_those_of_sorprox_over_the_contacts_in_the_order_of_colours(name: str) -> None:
    problem = load(name)
    colours = colour_contacts(in_pairs(problem.factor_pieces())).colours
    ordered = permuted(problem, np.argsort(colours, kind="stable"))
    found = iterates("WarpColouredSORprox(relaxation=1.2, device='cpu')", problem)
    sequential = iterates("SORprox(relaxation=1.2)", ordered.problem)
    expected = np.array([ordered.impulses(impulses) for impulses in sequential])
    assert np.abs(found - expected).max() <= 1e-11 * np.abs(expected).max()


@pytest.mark.parametrize("solver", ["WarpColouredSORprox(device='cpu')", "WarpJORprox(relaxation=0.3, device='cpu')"])
def test_a_device_repeats_its_bits_and_the_judge_confirms_them(solver: str) -> None:
    problem = load("funnel-100")
    first, second = (
        solve(problem, solver, tolerance=1e-5, max_iterations=20_000, max_seconds=np.inf) for _ in range(2)
    )
    assert first.status is Status.SOLVED
    assert first.impulses.tobytes() == second.impulses.tobytes()
    assert judge(problem, first.impulses).residual <= 1e-5
    assert "transfers" in first.message


@pytest.mark.parametrize("phase", ["prepare", "solve"])
def test_insufficient_device_memory_is_reported_in_one_sentence(phase: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Warp raises a bare RuntimeError in this form; other errors are not about memory."""
    solver, problem = create("WarpColouredSORprox(device='cpu')"), load("funnel-100")
    prepared = solver.prepare(problem)
    words = "Failed to allocate 123456 bytes on device 'cuda:0'"

    def fail(*_: object, **__: object) -> None:
        raise RuntimeError(words)

    def attempt() -> None:
        if phase == "prepare":
            solver.prepare(problem)
        else:
            prepared.solve(Stop(1e-3))

    monkeypatch.setattr(warp, "array", fail)
    with pytest.raises(InsufficientMemoryError) as raised:
        attempt()
    n_contacts = problem.n_contacts
    wanted = f"the memory of cpu does not suffice for {n_contacts} contacts; solve a smaller problem, or use a solver "
    assert str(raised.value) == f"{wanted}without a device."
    words = "an illegal memory access was encountered"
    with pytest.raises(RuntimeError, match="illegal"):
        attempt()


def test_the_name_always_says_the_device() -> None:
    assert create("WarpJORprox(device='cpu')").name == "WarpJORprox(device='cpu')"
    solver = create("WarpColouredSORprox", relaxation=1.2, device="cpu")
    assert solver.name == "WarpColouredSORprox(relaxation=1.2, device='cpu')"
    assert create(solver.name) == solver


@pytest.mark.skipif(warp.is_cuda_available(), reason="there is a graphics processor")
def test_a_missing_graphics_processor_is_reported_in_one_sentence() -> None:
    with pytest.raises(SolverError) as raised:
        create("WarpJORprox")
    assert str(raised.value) == "WarpJORprox needs a GPU for device='cuda', and there is none; use device='cpu'."


@pytest.mark.skipif(not warp.is_cuda_available(), reason="there is no graphics processor")
def test_recorded_graphs_do_the_same_sweeps() -> None:
    problem = load("funnel-300")
    for solver in ("WarpColouredSORprox(device={!r})", "WarpJORprox(relaxation=0.3, device={!r})"):
        there, here = (solve(problem, solver.format(device), tolerance=1e-4) for device in ("cuda", "cpu"))
        assert np.abs(there.impulses - here.impulses).max() <= 1e-9 * np.abs(here.impulses).max()
