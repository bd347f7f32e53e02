"""Solver objects of a caller are sent to their cases with their classes, wherever these are defined."""

import subprocess
import sys
import threading
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from proxbench.bench import load, run
from proxbench.bench.errors import BenchError
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.simulation.plan import make_simulation_plan
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import Model
from proxbench.solvers import create

CLASS = """
from proxbench.problems import Model
from proxbench.solvers import create

class Mine:
    name, model = "Mine", Model.COULOMB
    def supports(self, problem): return None
    def prepare(self, problem): return create("SORprox").prepare(problem)
"""

SCRIPT = (
    CLASS
    + """
print("begun")
from proxbench.bench import load, run
folder = run(["hard-groove"], [Mine()], results="results", tolerances=[1e-3], passes=1)
print(load(folder).cases["outcome"].tolist())
"""
)


def module_from(text: str, name: str) -> ModuleType:
    """A module that no other process can import."""
    spec = spec_from_loader(name, loader=None)
    assert spec is not None
    module = module_from_spec(spec)
    sys.modules[name] = module
    exec(text, module.__dict__)
    return module


@pytest.mark.weekly
@pytest.mark.parametrize("way", ["-", "script.py"])
def test_a_class_of_a_script_or_of_standard_input_is_measured_and_the_script_not_run_again(
    way: str, tmp_path: Path
) -> None:
    (tmp_path / "script.py").write_text(SCRIPT)
    text = SCRIPT if way == "-" else None
    done = subprocess.run([sys.executable, way], input=text, cwd=tmp_path, capture_output=True, text=True, timeout=600)
    assert done.stdout.splitlines() == ["begun", "['measured']"], done.stderr


@pytest.mark.slow
def test_a_class_of_a_module_that_cases_cannot_import_is_measured(tmp_path: Path) -> None:
    module: Any = module_from(CLASS, "made_in_memory")
    folder = run(["hard-groove"], [module.Mine()], results=tmp_path, tolerances=[1e-3], passes=1)
    assert load(folder).cases["outcome"].tolist() == [Outcome.MEASURED]


class Locked:
    name, model = "Locked", Model.COULOMB

    def __init__(self) -> None:
        self.lock = threading.Lock()

    def supports(self, problem: Any) -> None:
        """Support everything."""

    def prepare(self, problem: Any) -> Any:
        return create("SORprox").prepare(problem)


def test_unpicklable_object_is_rejected_before_measurement(tmp_path: Path) -> None:
    with pytest.raises(BenchError, match=r"Locked cannot be sent to the process of its cases \(TypeError: .*lock"):
        run(["hard-groove"], [Locked()], results=tmp_path / "results")
    assert not (tmp_path / "results").exists()


def test_an_object_that_is_no_solver_is_refused_in_a_sentence() -> None:
    thing: Any = 3
    with pytest.raises(BenchError, match="the solver int violates the interface: it has no name"):
        solver_spec(thing)


def test_a_built_in_solver_is_known_by_its_name_however_it_is_given() -> None:
    given = (create("SORprox", relaxation=1.5), "SORprox(relaxation = 1.5)")
    first, second = map(solver_spec, given)
    assert first == second == solver_spec(first)
    assert first.is_built_in
    assert first.make() == given[0]


def test_an_object_cannot_take_the_name_of_a_built_in_solver() -> None:
    kind: Any = module_from(CLASS, "made_in_memory").Mine
    kind.name = "Robust (of mine)"
    with pytest.raises(BenchError, match=r"has the name 'Robust \(of mine\)', which Proxbench itself uses"):
        solver_spec(kind())
    kind.name = "Robuster"
    assert solver_spec(kind()).name == "Robuster"


def test_subclass_cannot_take_the_name_of_another_built_in_solver() -> None:
    derived: Any = type("Robust", (type(create("NSGS")),), {})
    with pytest.raises(BenchError, match="has the name 'Robust'"):
        solver_spec(derived())
    with pytest.raises(BenchError, match="has the name 'Robust'"):
        make_simulation_plan("stack", solver=derived())
