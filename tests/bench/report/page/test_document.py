"""The data of a page agree with the run on accuracies, are small, and cannot leave their element of the file."""

import json
import re
import shlex
from dataclasses import replace
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest
from proxbench.bench.errors import BenchError
from proxbench.bench.report.accuracy import attempts
from proxbench.bench.report.charts.profiles import write_profiles
from proxbench.bench.report.page.assembly import page, write_page
from proxbench.bench.report.page.commands import option, repeat_command
from proxbench.bench.report.page.document import page_document
from proxbench.bench.report.profiles import baseline_of
from proxbench.bench.runs import Run
from proxbench.bench.store.frames import RunFrames


def enlarged(frames: RunFrames, problems: int, solvers: int) -> RunFrames:
    """A run with copies of its problems and solvers, to obtain these numbers of both."""
    plan = frames.info.plan
    names = [f"{plan.problems[k % len(plan.problems)]}-{k}" for k in range(problems)]
    more = [*plan.solvers, *(f"Other{k}" for k in range(solvers - len(plan.solvers)))]

    def copied(frame: pd.DataFrame) -> pd.DataFrame:
        extra = [frame[frame["solver"] == "NSGS"].assign(solver=name) for name in more[len(plan.solvers) :]]
        whole = pd.concat([frame, *extra])
        own = dict(iter(whole.groupby("problem")))
        parts = [
            own[plan.problems[k % len(plan.problems)]].assign(problem=name)
            for k, name in enumerate(names)
            if plan.problems[k % len(plan.problems)] in own
        ]
        return pd.concat(parts, ignore_index=True)

    kept = msgspec.structs.replace(plan, problems=names, solvers=more, families={})
    tables = {name: copied(getattr(frames, name)) for name in ("cases", "points", "iterations")}
    noise = np.random.default_rng(0).uniform(0.9, 1.1, len(tables["points"]))
    for column in ("total_seconds", "total_seconds_q1", "total_seconds_q3", "prepare_seconds", "residual"):
        tables["points"][column] *= noise
    tables["points"]["reason"] = [
        f"{text} ({value:.4g})" if text else "" for text, value in zip(tables["points"]["reason"], noise, strict=True)
    ]
    return replace(frames, info=msgspec.structs.replace(frames.info, plan=kept), **tables)


@pytest.mark.slow
def test_residuals_compare_with_accuracies_as_the_exact_ones(reference_run: Run) -> None:
    frames = reference_run
    draw = np.random.default_rng(0)
    exact = 10.0 ** draw.integers(-10, 0, len(frames.points)) * (
        1.0 + draw.choice([-1e-12, 0.0, 1e-12], len(frames.points))
    )
    points = frames.points.assign(residual=exact)
    cases = page_document(replace(frames, points=points), "NSGS")
    accuracies, columns = cases["accuracies"], cases["cases"]
    assert len(columns["residual"]) > 100
    for residual, seconds in zip(columns["residual"], columns["seconds"], strict=True):
        reached = [residual is not None and residual <= accuracy for accuracy in accuracies]
        assert reached == [value is not None for value in seconds]


@pytest.mark.slow
def test_cases_have_the_times_claims_and_exclusions_of_the_tables(reference_run: Run) -> None:
    frames = reference_run
    document = page_document(frames, "NSGS")
    table = attempts(frames, document["accuracies"]).set_index(["problem", "solver", "accuracy"])
    columns = (document["cases"][name] for name in ("problem", "solver", "supported", "seconds", "claimed", "excluded"))
    for problem, solver, supported, *values in zip(*columns, strict=True):
        for accuracy, seconds, claimed, excluded in zip(document["accuracies"], *values, strict=True):
            if supported:
                expected = table.loc[problem, solver, accuracy]
                assert (bool(claimed), bool(excluded)) == (expected["claimed"], expected["excluded"])
                assert np.nan_to_num(float("nan") if seconds is None else seconds) == pytest.approx(
                    np.nan_to_num(expected["seconds"]), rel=1e-6
                )


@pytest.mark.weekly
def test_variables_of_the_environment_are_in_a_table_apart_from_versions(reference_run: Run) -> None:
    frames = reference_run
    for settings, expected in (({"NUMBA_OPT": "1"}, [("NUMBA_OPT", "1")]), ({}, None)):
        machine = msgspec.structs.replace(frames.info.machine, settings=settings)
        document = page_document(replace(frames, info=msgspec.structs.replace(frames.info, machine=machine)), "NSGS")
        tables = document["machine"]
        assert tables.get("Environment") == expected
        assert dict(tables["Versions"]) == machine.versions


@pytest.mark.slow
def test_the_page_opens_a_problem_with_something_to_draw(reference_run: Run) -> None:
    frames = reference_run
    first = frames.info.plan.problems[0]
    assert page_document(frames, "NSGS")["open"] == first
    without = {
        name: getattr(frames, name)[getattr(frames, name)["problem"] != first] for name in ("points", "iterations")
    }
    assert page_document(replace(frames, **without), "NSGS")["open"] == frames.info.plan.problems[1]


@pytest.fixture(scope="module")
def quick(reference_run: Run) -> str:
    """The page of a quick run."""
    return page(reference_run)


@pytest.mark.weekly
def test_the_page_of_a_quick_run_is_small(quick: str) -> None:
    assert len(quick.encode()) < 3e6


@pytest.mark.weekly
def test_the_page_of_many_problems_and_solvers_is_not_large(reference_run: Run) -> None:
    frames = enlarged(reference_run, 250, 15)
    assert len(frames.cases) == 3750
    assert len(page(frames, "NSGS").encode()) < 8e6


@pytest.mark.weekly
def test_a_run_in_which_all_failed_has_a_page_and_charts(reference_run: Run, tmp_path: Path) -> None:
    frames = reference_run
    nothing = {name: getattr(frames, name).iloc[:0] for name in ("points", "rounds", "iterations")}
    failed = replace(frames, cases=frames.cases.assign(outcome="crashed", reason="signal 11", stderr="boom"), **nothing)
    document = page_document(failed, baseline_of(failed))
    assert set(document["cases"]["outcome"]) == {"crashed"}
    assert set(document["cases"]["stderr"]) == {"boom"}
    assert not any(document["points"].values())
    assert len(write_profiles(failed, "NSGS", tmp_path)) == 15


@pytest.mark.weekly
def test_a_run_of_one_solver_has_a_page_and_charts(reference_run: Run, tmp_path: Path) -> None:
    frames = reference_run
    tables = {name: getattr(frames, name) for name in ("cases", "points", "rounds", "iterations")}
    own = {name: table[table["solver"] == "NSGS"] for name, table in tables.items()}
    plan = msgspec.structs.replace(frames.info.plan, solvers=["NSGS"])
    single = replace(frames, info=msgspec.structs.replace(frames.info, plan=plan), **own)
    assert [solver["name"] for solver in page_document(single, "NSGS")["solvers"]] == ["NSGS"]
    assert len(write_profiles(single, "NSGS", tmp_path)) == 15


@pytest.mark.slow
def test_stored_text_cannot_inject_html_elements(reference_run: Run) -> None:
    frames = reference_run
    hostile = "</script><script>alert(1)</script><!-- <img src=x onerror=alert(1)> & \u2028"
    frames = replace(frames, cases=frames.cases.copy())
    frames.cases.loc[0, ["stderr", "reason", "family"]] = hostile

    class Tags(HTMLParser):
        def __init__(self) -> None:
            super().__init__()
            self.found: list[str] = []

        def handle_starttag(self, tag: str, attrs: object) -> None:
            self.found.append(tag)

    tags = Tags()
    made = page(frames)
    tags.feed(made)
    assert tags.found.count("script") == 3
    assert "img" not in tags.found
    embedded = re.search(r'<script type="application/json" id="run">(.*?)</script>', made, re.DOTALL)
    assert embedded is not None
    assert hostile in json.loads(embedded[1])["cases"]["stderr"]


@pytest.mark.slow
def test_the_page_refers_to_nothing_outside(quick: str) -> None:
    own = quick[: quick.index('<script type="application/json"')]
    assert not re.search(r"\b(src|href)=\"(?!#)|@import|url\(", own)
    assert "default-src 'none'" in own


@pytest.mark.slow
def test_the_command_of_a_run_names_all_that_it_measured(reference_run: Run) -> None:
    info = reference_run.info
    words = shlex.split(repeat_command(info).replace("\\\n", ""))
    for option_name, names in (("--problem", info.plan.problems), ("--solver", info.plan.solvers)):
        assert [value for name, value in pairwise(words) if name == option_name] == names


@pytest.mark.parametrize(
    "name", ["NSGS", "S(form='factors')", "it's $HOME `ls` \\", "both \" and '", "-x; rm *", "!1 'a'"]
)
def test_names_are_quoted_as_one_shell_word(name: str) -> None:
    assert shlex.split(option("solver", name)) == ["--solver", name]


@pytest.mark.weekly
def test_a_study_has_no_page(reference_run: Run) -> None:
    class Study(Run):
        is_study = property(lambda self: True)

    with pytest.raises(BenchError, match="study of simulations"):
        Study(**vars(reference_run)).page()


@pytest.mark.slow
def test_a_page_is_written_into_the_folder_of_its_run_and_residual(reference_run: Run, tmp_path: Path) -> None:
    frames = replace(reference_run, folder=tmp_path)
    assert write_page(frames) == tmp_path / "report.html"
    assert write_page(frames.judged_by("local")) == tmp_path / "local/report.html"
