"""Plugin files: their solvers and problems can be named in every process, and their faults are reported."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from proxbench.bench import load, resume, run
from proxbench.bench.cli.main import run_command
from proxbench.bench.errors import BenchError
from proxbench.bench.plugins.descriptions import solver_spec
from proxbench.bench.plugins.files import use_plugin_files
from proxbench.bench.plugins.problems import resolve_problem
from proxbench.bench.store.outcome import Outcome
from proxbench.problems import PluginError
from proxbench.problems import load as load_problem
from proxbench.problems.exchange.plugins.offers import forget, registered
from proxbench.solvers import available

GOOD = """
from dataclasses import dataclass
import numpy as np
from proxbench.problems import ContactProblem, Model, project
from proxbench.solvers import iterate, name_with_options

@dataclass(frozen=True)
class Filed:
    relaxation: float = 1.0
    model = Model.COULOMB
    name = property(name_with_options)

    def supports(self, problem):
        return None

    def prepare(self, problem):
        step = self.relaxation / abs(problem.delassus()).sum(axis=1).max()
        def sweeps(impulses):
            while True:
                impulses = project(problem.laws, impulses - step * problem.relative_velocity(impulses))
                yield impulses
        return iterate(problem, sweeps)

def falling():
    return ContactProblem.from_delassus(np.eye(3), (-1.0, 0.5, 0.0), 0.3)

SOLVERS = [Filed]
PROBLEMS = {"falling-point": falling}
"""


@pytest.fixture(autouse=True)
def nothing_registered() -> Iterator[None]:
    """Unregister the plugins of a test."""
    yield
    for file, _ in registered():
        forget(file)


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    """Write a plugin file."""

    def write(text: str, name: str = "mine.py") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write


@pytest.mark.slow
def test_solvers_and_problems_of_a_plugin_file_can_be_measured(written: Callable[..., Path], tmp_path: Path) -> None:
    use_plugin_files([written(GOOD)])
    assert "Filed" in available()
    assert solver_spec("Filed(relaxation = 1.5)").name == "Filed(relaxation=1.5)"
    assert resolve_problem("falling-point").name == "falling-point"
    folder = run(
        ["falling-point", "hard-sticking-box"],
        ["Filed(relaxation=1.5)", "SORprox"],
        results=tmp_path,
        tolerances=[1e-4],
    )
    frames = load(folder)
    assert (frames.cases["outcome"] == Outcome.MEASURED).all()
    assert (frames.points["outcome"] == Outcome.SOLVED).all()


@pytest.mark.slow
def test_a_case_runs_what_was_read_even_if_the_file_is_edited_meanwhile(
    written: Callable[..., Path], tmp_path: Path
) -> None:
    path = written(GOOD)
    use_plugin_files([path])
    path.write_text("raise RuntimeError('edited')")
    folder = run(["falling-point"], ["Filed"], results=tmp_path, tolerances=[1e-4], passes=1)
    assert load(folder).cases["outcome"].tolist() == [Outcome.MEASURED]


CHANGING = """
class Changing(Filed):
    count = 0

    @property
    def name(self):
        Changing.count += 1
        return "Changing" if self.count <= 2 else "Robust"

SOLVERS = [Changing]
"""


def test_a_solver_that_changes_its_name_once_it_is_made_is_refused(written: Callable[..., Path]) -> None:
    use_plugin_files([written(GOOD + CHANGING)])
    with pytest.raises(PluginError, match="the solver 'Changing' has the name 'Robust'; set its name to the one"):
        solver_spec("Changing")


CLASS = "from proxbench.problems import Model\nclass Mine:\n"
NAME, MODEL = "    name = 'Mine'\n", "    model = Model.COULOMB\n"
SUPPORTS = "    def supports(self, problem): return None\n"
PREPARE = "    def prepare(self, problem): return None\n"
OFFERED = "SOLVERS = [Mine]\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = (", "fails to import on line 1: SyntaxError"),
        ("import numpy\n\n1 / 0\n", "fails to import on line 3: ZeroDivisionError: division by zero"),
        ("import no_such_module", "fails to import on line 1: ModuleNotFoundError: No module named 'no_such_module'"),
        ("raise SystemExit(3)", "fails to import on line 1: SystemExit: 3"),
        ("x = 1", "offers nothing; list its solver classes, SOLVERS = [MySolver]"),
        (CLASS + PREPARE, "offers nothing; list its solver classes, SOLVERS = [Mine]"),
        (CLASS + PREPARE + "SOLVERS = Mine\n", "SOLVERS must be a list of solver classes"),
        ("PROBLEMS = [abs]", "PROBLEMS must map names to functions"),
        ("def SORprox(): pass\nSOLVERS = [SORprox]", "solver 'SORprox', a name that Proxbench itself uses; give it"),
        ("PROBLEMS = {'funnel-30': abs}", "problem 'funnel-30', a name that Proxbench itself uses"),
        ("PROBLEMS = {'a/b': abs}", "a problem's name must be made of letters"),
        (CLASS + MODEL + SUPPORTS + PREPARE + OFFERED, "it has no name, the text in tables; add name = "),
        (CLASS + NAME + SUPPORTS + PREPARE + OFFERED, "it has no model, the model that it solves; add model = "),
        (CLASS + NAME + "    model = 'coulomb'\n" + SUPPORTS + PREPARE + OFFERED, "its model is a str, not"),
        (CLASS + NAME + MODEL + SUPPORTS + PREPARE + "SOLVERS = [Mine, Mine]\n", "offers the name 'Mine' twice"),
        (CLASS + NAME + MODEL + PREPARE + OFFERED, "it has no method supports(problem)"),
        (CLASS + NAME + MODEL + SUPPORTS + OFFERED, "it has no method prepare(problem)"),
        (
            CLASS + NAME + MODEL + SUPPORTS + "    def prepare(self): pass\n" + OFFERED,
            "it has prepare(), which cannot be called as prepare(problem)",
        ),
        (
            CLASS + "    name = 'Yours'\n" + MODEL + SUPPORTS + PREPARE + OFFERED,
            "its name is 'Yours', but must begin with 'Mine'",
        ),
        (CLASS + "    def __init__(self, omega): pass\n" + OFFERED, "cannot be created without 'omega'; give every"),
        (CLASS + "    def __init__(self): 1 / 0\n" + OFFERED, "cannot be created: ZeroDivisionError"),
        (CLASS + "    def __init__(self, *omega): pass\n" + OFFERED, "takes *omega; give every option a name"),
    ],
)
def test_a_faulty_plugin_file_gets_one_sentence_and_exit_code_two(
    text: str, words: str, written: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = written(text)
    for line in (["run", "--output", str(tmp_path / "results"), "--plugin", str(path)], ["check", str(path)]):
        assert run_command(line) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.count("\n") == 1
        assert words in printed.err
        assert str(path) in printed.err
        assert registered() == []
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import os; os._exit(0)", "its process ended with exit code 0"),
        ("import ctypes; ctypes.string_at(0)", "its process was killed by SIGSEGV"),
        ("import os; os.fork() or __import__('time').sleep(2); os._exit(3)", "its process ended with exit code 3"),
        ("x = bytearray(2**33)", "it raised MemoryError when it requested more than 2048 MiB of memory"),
    ],
    ids=["exit", "segfault", "leaves a process", "memory"],
)
def test_a_plugin_file_that_ends_the_importing_process_gets_one_sentence(
    code: str, words: str, written: Callable[..., Path], capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = written(GOOD + code)
    assert run_command(["run", "--output", str(tmp_path / "results"), "--plugin", str(path)]) == 2
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert f"{words}; correct the code that it runs." in printed.err
    assert registered() == []
    assert not (tmp_path / "results").exists()


def test_missing_plugin_file_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    for line in ("run --plugin nowhere.py", "list --plugin nowhere.py", "check nowhere.py"):
        assert run_command(line.split()) == 2
        assert "there is no plugin file" in capsys.readouterr().err


def test_two_files_with_one_name_are_refused_and_the_first_stays(written: Callable[..., Path]) -> None:
    use_plugin_files([written(GOOD)])
    with pytest.raises(
        PluginError, match=r"other\.py offers the solver 'Filed', and plugin file .*mine\.py offers the"
    ):
        use_plugin_files([written(GOOD, "other.py")])
    assert solver_spec("Filed").name == "Filed"


def test_a_name_that_hides_its_options_is_refused(written: Callable[..., Path]) -> None:
    use_plugin_files([written(GOOD.replace("name = property(name_with_options)", "name = 'Filed'"))])
    with pytest.raises(PluginError, match=r"with relaxation=1.5 its name is still 'Filed'"):
        solver_spec("Filed(relaxation=1.5)")


def test_an_unknown_option_of_a_plugin_is_answered_with_the_nearest(written: Callable[..., Path]) -> None:
    use_plugin_files([written(GOOD)])
    with pytest.raises(PluginError, match="'relaxation'"):
        solver_spec("Filed(relaxtion=1)")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "outcome", "words"),
    [
        pytest.param(
            "return None", "return True", Outcome.MISBEHAVED, "its supports returned True", marks=pytest.mark.slow
        ),
        pytest.param(
            "return iterate(problem, sweeps)",
            "return 3",
            Outcome.MISBEHAVED,
            "its prepare returned an int, which has no",
            marks=pytest.mark.weekly,
        ),
        ("yield impulses", "yield impulses[1:]", Outcome.CRASHED, "yielded an array of shape (2,)"),
        pytest.param(
            "return iterate",
            "import threading; self.__dict__['x'] = 1; raise ValueError('no') #",
            Outcome.CRASHED,
            "no",
            marks=pytest.mark.weekly,
        ),
    ],
)
def test_plugin_without_the_interface_affects_only_its_own_case(
    old: str, new: str, outcome: Outcome, words: str, written: Callable[..., Path], tmp_path: Path
) -> None:
    path = written(GOOD.replace(old, new))
    folder = run(["falling-point"], ["Filed", "SORprox"], results=tmp_path, tolerances=[1e-4], passes=1, plugins=[path])
    cases = load(folder).cases.set_index("solver")
    assert cases.loc["SORprox", "outcome"] == Outcome.MEASURED
    assert cases.loc["Filed", "outcome"] == outcome
    assert words in cases.loc["Filed", "reason"]


def test_plugin_that_hides_its_source_is_not_a_built_in_solver(
    written: Callable[..., Path],
) -> None:
    """Built-in solvers may exclude work outside a library from their times."""
    lie = "descriptions._solver = lambda name, pickled: {**known(name, pickled), 'source': ''}"
    patch = f"from proxbench.bench.plugins import descriptions\nknown = descriptions._solver\n{lie}\n"
    use_plugin_files([written(GOOD + patch)])
    assert not solver_spec("Filed").is_built_in


@pytest.mark.slow
def test_a_solver_of_a_file_may_hold_what_cannot_be_pickled(written: Callable[..., Path], tmp_path: Path) -> None:
    text = GOOD.replace(
        "    relaxation: float = 1.0\n", "    def __post_init__(self): self.__dict__['f'] = lambda: 0\n"
    )
    path = written(text.replace("self.relaxation", "1.0"))
    folder = run(["falling-point"], ["Filed"], results=tmp_path, tolerances=[1e-4], passes=1, plugins=[path])
    assert load(folder).cases["outcome"].tolist() == [Outcome.MEASURED]


@pytest.mark.slow
def test_a_problem_that_cannot_be_built_is_named_before_anything_is_measured(
    written: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    for body, words in (("return 3", "returns a value of type int"), ("1 / 0", "cannot be built: ZeroDivisionError")):
        path = written(f"def f():\n    {body}\nPROBLEMS = {{'mine': f}}")
        results = tmp_path / "results"
        for line in (["generate", "mine"], ["run", "--problem", "mine", "--output", str(results)]):
            assert run_command([*line, "--plugin", str(path)]) == 2
            assert words in capsys.readouterr().err
        assert not results.exists()


@pytest.mark.slow
def test_resume_requires_the_file_and_refuses_another_version(written: Callable[..., Path], tmp_path: Path) -> None:
    path = written(GOOD)
    folder = run(
        ["falling-point"], ["Filed", "SORprox"], results=tmp_path, tolerances=[1e-4], passes=1, plugins=[path]
    ).folder
    recorded = load(folder).info.plugins
    assert {(use.kind, use.name) for use in recorded} == {("solver", "Filed"), ("problem", "falling-point")}
    assert {use.file for use in recorded} == {str(path)}
    ((file, _),) = registered()
    assert {use.sha256 for use in recorded} == {file.sha256}
    forget(file)

    lost = next(iter((folder / "cases").glob("*Filed*")))
    lost.unlink()
    with pytest.raises(BenchError, match=r"mine\.py; name it with `plugins`"):
        resume(folder)
    assert resume(folder, plugins=[path]).folder == folder
    assert len(load(folder).cases) == 2

    path.write_text(GOOD + "# edited\n")
    with pytest.raises(BenchError, match=r"mine\.py has changed since the run began; restore the old version"):
        resume(folder, plugins=[path])
    for file, _ in registered():
        forget(file)
    path.unlink()
    with pytest.raises(BenchError, match=r"plugin file .*mine\.py, which is missing; restore it"):
        resume(folder)


@pytest.mark.slow
def test_resuming_a_run_requires_its_plugins_to_be_given(
    written: Callable[..., Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    path = written(GOOD)
    folder = run(["falling-point"], ["Filed"], results=tmp_path, tolerances=[1e-4], passes=1, plugins=[path]).folder
    for file, _ in registered():
        forget(file)
    assert run_command(["run", "--resume", str(folder)]) == 2
    assert f"plugin file {path}; name it with --plugin" in capsys.readouterr().err
    assert registered() == []
    assert run_command(["run", "--resume", str(folder), "--no-charts", "--plugin", str(path)]) == 0


def test_a_generated_problem_is_found_without_the_plugin(
    written: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PROXBENCH_CACHE", str(tmp_path / "cache"))
    assert run_command(["generate", "falling-point", "--json", "--plugin", str(written(GOOD))]) == 0
    (digest,) = json.loads(capsys.readouterr().out).values()
    for file, _ in registered():
        forget(file)
    assert load_problem("falling-point").digest == digest


def test_what_a_file_prints_when_imported_does_not_spoil_json(
    written: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    path = written("print('hello')\n" + GOOD)
    assert run_command(["list", "solvers", "--json", "--plugin", str(path)]) == 0
    rows = json.loads(capsys.readouterr().out)["solvers"]
    mine = next(row for row in rows if row["name"] == "Filed")
    assert (mine["model"], mine["options"], mine["error"]) == ("coulomb", ["relaxation=1.0"], "")
    assert mine["source"] == f"plugin file {path}"
