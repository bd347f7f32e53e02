"""A plugin file is tried in a process of its own, so that its import cannot spoil the run that imports it then."""

import os
import threading
from pathlib import Path

import psutil
import pytest
from proxbench.bench.cli.main import run_command
from proxbench.bench.isolation import plugin_trial
from proxbench.bench.isolation.plugin_trial import try_import
from proxbench.problems import judge
from proxbench.problems.catalog.plugin_files import PluginFile
from proxbench.problems.errors import PluginError

SOLVER = """
import atexit, os, signal, subprocess, sys, threading, time
from dataclasses import dataclass
import numpy as np
from proxbench.problems import Model
from proxbench.solvers import create

@dataclass(frozen=True)
class Mine:
    name, model = "Mine", Model.COULOMB
    def supports(self, problem):
        return None
    def prepare(self, problem):
        return create("SORprox").prepare(problem)

SOLVERS = [Mine]
"""

DESTRUCTOR = """
class Slow:
    def __del__(self):
        time.sleep(1000)
_kept = Slow()
"""

PATCHED_WHEN_MADE = """
def _patched(self):
    import proxbench.bench.measure.case as case
    case.point_outcome = lambda *arguments: "solved"
    return "Mine"
Mine.name = property(_patched)
"""


@pytest.fixture
def written(tmp_path: Path) -> "Writer":
    return Writer(tmp_path / "mine.py")


class Writer:
    """Writes a plugin file with something more at its end."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __call__(self, more: str) -> PluginFile:
        self.path.write_text(SOLVER + more)
        return PluginFile.read(self.path)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("os._exit(0)", "fails to import: it ends the process with exit code 0;"),
        ("os.abort()", "fails to import: it ends the process with SIGABRT;"),
        ("raise KeyboardInterrupt", "fails to import: KeyboardInterrupt;"),
        ("class Own(BaseException): pass\nraise Own('no')", "fails to import: Own: no;"),
        ("while True: pass", "does not come back within 1 s from its import"),
        ("Mine.name = property(lambda self: time.sleep(1000))", "does not come back within 1 s from its import"),
        ("Mine.__reduce__ = lambda self: os._exit(5)", "exit code 5"),
        ("os.closerange(3, 1000); time.sleep(1000)", "it closes what connects its process to others"),
        (
            "from proxbench.problems.judge import Residual\nResidual.__call__ = lambda *found: 0.0",
            "replaces proxbench.problems.contact.judge.Residual.__call__ when",
        ),
        (
            "import proxbench.bench.measure.runner as r\nr.judge_kindly = 1",
            "replaces proxbench.bench.measure.runner.judge_kindly when",
        ),
        ("time.perf_counter = lambda: 0.0", "replaces time.perf_counter when"),
        ("np.isfinite = lambda found: True", "replaces numpy.isfinite when"),
        (PATCHED_WHEN_MADE, "replaces proxbench.bench.measure.case.point_outcome when"),
        ("os.chdir('/')", "changes the working folder when"),
        ("np.seterr(all='raise')", "changes numpy's error state when"),
        ("sys.stdout.close()", "changes the standard streams when"),
        ("signal.signal(signal.SIGINT, signal.SIG_IGN)", "changes signal handlers when"),
        ("signal.alarm(1)", "changes the alarm clock when"),
        ("subprocess.Popen(['sleep', '100'], start_new_session=True)", "leaves 1 process behind when"),
        ("os.fork() or os.fork() or time.sleep(100)", "behind when it is imported"),
        ("threading.Thread(target=time.sleep, args=(1000,)).start()", "keeps its process from ending"),
        ("atexit.register(time.sleep, 1000)", "keeps its process from ending"),
        (DESTRUCTOR, "keeps its process from ending"),
    ],
)
def test_a_file_that_would_spoil_its_process_is_refused_in_a_sentence(
    more: str, words: str, written: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(plugin_trial, "END_SECONDS", 0.5)
    before, folder = set(psutil.Process().children(recursive=True)), os.getcwd()
    with pytest.raises(PluginError) as told:
        try_import(written(more), seconds=1.0 if "does not come back" in words else 60.0)
    assert words in str(told.value)
    assert str(told.value).endswith("a plugin file must only define things.")
    _, left = psutil.wait_procs(set(psutil.Process().children(recursive=True)) - before, timeout=2.0)
    assert left == []
    assert os.getcwd() == folder


@pytest.mark.parametrize(
    "more",
    [
        "",
        "raise ValueError('told by the import that follows')",
        "import logging, warnings; warnings.warn('look')",
        "np.random.seed(0); os.environ.setdefault('MY_LIBRARY', 'quiet')",
        "threading.Thread(target=time.sleep, args=(1000,), daemon=True).start()",
        "atexit.register(print, 'goodbye')",
        "print('hello')",
    ],
)
def test_a_file_that_does_what_libraries_do_is_left_alone(more: str, written: Writer) -> None:
    try_import(written(more))
    assert threading.active_count() >= 1


def test_the_process_of_the_run_is_not_touched(written: Writer, capsys: pytest.CaptureFixture[str]) -> None:
    import proxbench.bench.measure.case as case

    file = written("import proxbench.bench.measure.case as c\nc.judge = None\n")
    assert run_command(["run", "--plugin", str(file.path)]) == 2
    assert run_command(["check", str(file.path)]) == 2
    assert case.judge is judge
    assert capsys.readouterr().err.count("replaces proxbench.bench.measure.case.judge when it is imported") == 2
