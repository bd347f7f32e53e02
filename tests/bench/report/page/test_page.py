"""The page in a browser: no errors, no requests; filters agree with the tables, and texts are not interpreted."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import msgspec
import numpy as np
import pandas as pd
import pytest
from headless_chromium import Chromium, chromium
from proxbench.bench.report.accuracy import summary_table
from proxbench.bench.report.cells import duration, mean_texts
from proxbench.bench.report.page.assembly import page
from proxbench.bench.report.profiles import ALL, COMMON, EVERY, profile_tables, seconds_matrix
from proxbench.bench.store.frames import RunFrames

pytestmark = pytest.mark.skipif(
    not chromium(), reason="no Chromium is installed; put one on the path, or name it by PROXBENCH_CHROMIUM"
)

MEANS = ("mean_time", "own_mean_time")
"""Prefixes of the means of a summary."""

PROFILES_OVER = "#filters label:nth-of-type(3) select"
"""Selector of the field that chooses the problems of profiles."""


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    with Chromium() as one:
        yield one


@pytest.fixture(scope="module")
def reference(browser: Chromium, reference_run: RunFrames, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("page") / "report.html"
    file.write_text(page(reference_run, "NSGS"), encoding="utf-8")
    return file


def opened(browser: Chromium, file: Path) -> None:
    browser.errors.clear()
    browser.requests.clear()
    browser.open(file)


def unfiltered(browser: Chromium, file: Path) -> None:
    """Open a page, unless it is shown already with the address of no filter and no selection."""
    if browser.errors or browser.evaluate("location.href") not in (file.as_uri(), f"{file.as_uri()}#"):
        opened(browser, file)


def uncheck(browser: Chromium, names: list[str]) -> None:
    """Uncheck the boxes with these labels, and wait for the charts."""
    for name in names:
        find = f"[...document.querySelectorAll('#filters label')].find((one) => one.textContent === {json.dumps(name)})"
        assert browser.evaluate(f"{find}.querySelector('input').click(), true")
    browser.evaluate("proxbench.render()")


def enter(browser: Chromium, field: str, value: str, event: str) -> None:
    """Enter a value in the first field that a selector finds, and wait for the charts."""
    script = f"""(() => {{ const field = document.querySelector({json.dumps(field)}); field.value = {json.dumps(value)};
        field.dispatchEvent(new Event({json.dumps(event)}, {{ bubbles: true }})); }})()"""
    browser.evaluate(script)
    browser.evaluate("proxbench.render()")


def go(browser: Chromium, address: str) -> None:
    """Go to an address within the page, and wait for the charts."""
    browser.evaluate(f"location.hash = {json.dumps(address)}")
    browser.evaluate("new Promise((done) => setTimeout(done, 300)).then(() => proxbench.render())")


def text_of(browser: Chromium, place: str) -> str:
    return str(browser.evaluate(f"document.getElementById('{place}').textContent"))


def shown(browser: Chromium, place: str) -> pd.DataFrame:
    """The texts of a table."""
    script = f"""[...document.querySelectorAll('#{place} tr')].map(
        (row) => [...row.cells].map((cell) => cell.textContent.trim()))"""
    head, *rows = browser.evaluate(script)
    return pd.DataFrame(rows, columns=head)


def without(frames: RunFrames, solvers: list[str], families: list[str]) -> RunFrames:
    """Return a run without some solvers and families."""
    plan = frames.info.plan
    kept = frames.only([name for name in plan.problems if plan.families[name] not in families])
    tables = {name: getattr(kept, name) for name in ("cases", "points", "rounds", "iterations")}
    chosen = {name: table[~table["solver"].isin(solvers)] for name, table in tables.items()}
    left = msgspec.structs.replace(kept.info.plan, solvers=[name for name in plan.solvers if name not in solvers])
    return replace(kept, info=msgspec.structs.replace(kept.info, plan=left), **chosen)


def profile_of(tables: dict[str, pd.DataFrame], name: str, view: str = COMMON, family: str = ALL) -> pd.DataFrame:
    """Return a profile to 1e-6 over all families or one, in ``view``, or over every problem if that view is empty."""
    table = tables[name]
    own = table[(table["family"] == family) & (table["accuracy"] == 1e-6 if "accuracy" in table else True)]
    if "view" in own:
        own = own[own["view"] == (view if (own["view"] == view).any() else EVERY)]
    labels = ["accuracy", "family", "view", "problems", "baseline"]
    return own.drop(columns=labels, errors="ignore").reset_index(drop=True)


def test_page_opens_without_errors_or_network_requests(browser: Chromium, finished: RunFrames, tmp_path: Path) -> None:
    (file := tmp_path / "report.html").write_text(page(finished), encoding="utf-8")
    opened(browser, file)
    assert browser.errors == []
    assert browser.requests == [file.as_uri()]
    assert browser.evaluate("document.querySelectorAll('.drawing svg').length") == 6
    assert browser.evaluate("document.title") == f"Proxbench: {finished.info.run_id}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("solvers", "families"),
    [
        pytest.param([], [], marks=pytest.mark.weekly),
        pytest.param(["Lemke", "ClarabelSOCP", "SafeguardedSORprox"], [], marks=pytest.mark.weekly),
        (["Jprox", "Lemke"], ["woodpecker", "hard: rods"]),
    ],
)
def test_filters_give_what_the_tables_compute(
    browser: Chromium, reference: Path, reference_run: RunFrames, solvers: list[str], families: list[str]
) -> None:
    opened(browser, reference)
    uncheck(browser, [*solvers, *families])
    left = without(reference_run, solvers, families)
    tables = profile_tables(left, "NSGS")
    expected = summary_table(left).set_index("solver")
    found = shown(browser, "summary-table").set_index("solver")
    assert list(found.index) == list(expected.index)
    means = {key: dict(zip(expected.index, mean_texts(expected, key, "1e-06"), strict=True)) for key in MEANS}
    for solver, row in expected.iterrows():
        claimed, confirmed = (round(row[f"{kind}_1e-06"] * row["problems"]) for kind in ("success", "correct"))
        counts = [f"{count}/{row['problems']}" for count in (claimed, confirmed)]
        assert found.loc[solver, ["claimed", "confirmed"]].tolist() == counts
        assert found.loc[solver, ["mean", "own mean"]].tolist() == [means[key][str(solver)] for key in MEANS]
        assert found.loc[solver, "wrong"] == str(row["wrong"])
    seconds = seconds_matrix(left, 1e-6)
    for view, chosen in ((COMMON, "common problems"), (EVERY, "all problems")):
        enter(browser, PROFILES_OVER, chosen, "change")
        for name in ("performance", "data", "accuracy", "speedup"):
            profile = profile_of(tables, name, view)
            rows = pd.DataFrame(browser.evaluate(f"proxbench.figures.{name}.rows()"))
            pd.testing.assert_frame_equal(rows[profile.columns], profile, rtol=1e-6, check_dtype=False)
    wins = (seconds.eq(seconds.min(axis=1), axis=0)).sum()
    assert found["fastest"].astype(int).to_dict() == wins[found.index].to_dict()
    assert browser.errors == []


@pytest.mark.slow
def test_size_law_model_name_and_accuracy_choose_what_is_shown(
    browser: Chromium, reference: Path, reference_run: RunFrames
) -> None:
    opened(browser, reference)
    uncheck(browser, ["planar friction (2 rows)", "convex", "pyramid(4)"])
    enter(browser, "input[placeholder='at most']", "1000", "change")
    enter(browser, "input[type='search']", "FUNNEL", "input")
    enter(browser, "#filters select", "1e-4", "change")
    cases = reference_run.cases
    kept = cases["problem"].str.contains("funnel") & (cases["n_rows"] != 2 * cases["n_contacts"])
    kept &= cases["n_contacts"] <= 1000
    problems = cases["problem"][kept].unique()
    solvers = cases["solver"][~cases["model"].isin(["convex", "pyramid(4)"])].unique()
    seconds = seconds_matrix(reference_run, 1e-4).loc[problems, solvers]
    assert set(problems) == {"funnel-100", "funnel-frictionless-300"}
    found = shown(browser, "problems-table")
    assert found["problem"].tolist() == list(problems)
    assert found["fastest"].tolist() == seconds.idxmin(axis=1).tolist()
    assert found["time"].tolist() == seconds.min(axis=1).map(duration).tolist()
    assert shown(browser, "summary-table")["solver"].tolist() == list(solvers)
    counts = browser.evaluate("document.getElementById('counts').textContent")
    assert counts == f"2 of 8 problems, {len(solvers)} of 15 solvers, to a judged residual of 1e-4"
    assert browser.errors == []


@pytest.mark.slow
def test_profiles_by_family_are_those_of_each_family(
    browser: Chromium, reference: Path, reference_tables: dict[str, pd.DataFrame]
) -> None:
    opened(browser, reference)
    uncheck(browser, ["profiles by family"])
    rows = pd.DataFrame(browser.evaluate("proxbench.figures.performance.rows()"))
    for family, own in rows.groupby("family"):
        profile = profile_of(reference_tables, "performance", family=str(family))
        pd.testing.assert_frame_equal(own[profile.columns].reset_index(drop=True), profile, rtol=1e-6)
    assert browser.errors == []


@pytest.mark.slow
def test_profiles_say_which_problems_they_are_over(browser: Chromium, finished: RunFrames, tmp_path: Path) -> None:
    frames, file = finished, tmp_path / "report.html"
    is_declined = (frames.cases["problem"] == "funnel-30") & (frames.cases["solver"] == "ClarabelSOCP")
    cases = frames.cases.assign(outcome=frames.cases["outcome"].where(~is_declined, "unsupported"))
    file.write_text(page(replace(frames, cases=cases), "SORprox"), encoding="utf-8")
    opened(browser, file)
    for chosen, over, axis in (
        ("common", "Shares are over the 2 of 3 problems that all 5 solvers support.", "share of 2 common problems"),
        ("all", "Shares are over all 3 problems; unsupported ones count as not solved.", "share of 3 problems"),
    ):
        enter(browser, PROFILES_OVER, f"{chosen} problems", "change")
        assert browser.evaluate("document.getElementById('profiles-over').textContent") == over
        titles = "[...document.querySelectorAll('#performance .role-axis-title')].map((one) => one.textContent)"
        assert axis in browser.evaluate(titles)
        cells = shown(browser, "budgets-table").iloc[0].tolist()[1:]
        assert {cell.rpartition("/")[2] for cell in cells} == {"2" if chosen == "common" else "3"}
    assert browser.errors == []


@pytest.mark.slow
def test_empty_selection_shows_nothing_without_errors(
    browser: Chromium, reference: Path, reference_run: RunFrames
) -> None:
    opened(browser, reference)
    uncheck(browser, list(dict.fromkeys(reference_run.info.plan.families.values())))
    assert browser.errors == []
    assert browser.evaluate("proxbench.figures.performance.rows().length") == 0
    counts = browser.evaluate("document.getElementById('counts').textContent")
    assert counts.endswith("; nothing matches the filters: select more")
    uncheck(browser, list(dict.fromkeys(reference_run.info.plan.families.values())))
    assert browser.evaluate("proxbench.figures.performance.rows().length") > 0
    assert browser.errors == []


@pytest.mark.slow
def test_heads_sort_tables_by_their_numbers(browser: Chromium, reference: Path) -> None:
    unfiltered(browser, reference)
    head = "[...document.querySelectorAll('#problems-table th button')].find((one) => one.textContent === 'contacts')"
    for order in ("ascending", "descending"):
        browser.evaluate(f"{head}.click()")
        contacts = shown(browser, "problems-table")["contacts"].astype(int).tolist()
        assert contacts == sorted(contacts, reverse=order == "descending")
        assert browser.evaluate(f"{head}.parentElement.getAttribute('aria-sort')") == order


@pytest.mark.slow
def test_an_address_opens_a_case_with_all_that_is_known_of_it(
    browser: Chromium, reference: Path, reference_run: RunFrames
) -> None:
    opened(browser, reference)
    go(browser, "#problem=funnel-100&case=NSGS")
    text = browser.evaluate("document.getElementById('case-view').textContent")
    cases = reference_run.cases
    case = cases[(cases["problem"] == "funnel-100") & (cases["solver"] == "NSGS")].iloc[0]
    for part in ("NSGS on funnel-100", case["digest"], "--problem funnel-100", "--solver NSGS", "coulomb"):
        assert part in text
    assert browser.evaluate("document.querySelectorAll('#case-view .drawing svg').length") == 2
    assert len(shown(browser, "case-view")) == len(reference_run.info.plan.tolerances)
    assert browser.errors == []


@pytest.mark.slow
def test_the_address_keeps_filters_by_their_names(browser: Chromium, reference: Path) -> None:
    opened(browser, reference)
    uncheck(browser, ["Lemke", "hard: rods"])
    enter(browser, "#filters select", "1e-4", "change")
    enter(browser, PROFILES_OVER, "all problems", "change")
    address, table = browser.evaluate("location.hash"), shown(browser, "summary-table")
    counts = text_of(browser, "counts")
    for words in ("without-solver=Lemke", "without-family=hard%3A+rods", "accuracy=0.0001", "profiles=all"):
        assert words in address
    go(browser, "#all=")
    assert text_of(browser, "counts") == "8 of 8 problems, 15 of 15 solvers, to a judged residual of 1e-6"
    go(browser, address)
    pd.testing.assert_frame_equal(shown(browser, "summary-table"), table)
    assert text_of(browser, "counts") == counts
    unchecked = "[...document.querySelectorAll('#filters input[type=checkbox]')].filter((one) => !one.checked).length"
    assert browser.evaluate(unchecked) == 3  # a solver, a family, and profiles by family
    go(browser, "#without-solver=gone&accuracy=7&problem=gone")
    assert text_of(browser, "counts").startswith("8 of 8 problems, 15 of 15 solvers, to a judged residual of 1e-6")
    assert browser.errors == []


@pytest.mark.slow
def test_unsupported_cases_are_apart_from_failures(
    browser: Chromium, reference: Path, reference_run: RunFrames
) -> None:
    unfiltered(browser, reference)
    cases = reference_run.cases
    unsupported = cases[cases["outcome"] == "unsupported"]
    assert len(unsupported)
    assert "unsupported" not in set(shown(browser, "failures-table")["outcome"])
    found = shown(browser, "unsupported-table")
    assert found["number"].astype(int).sum() == len(unsupported)
    assert set(found["solver"]) == set(unsupported["solver"])


@pytest.mark.slow
def test_the_page_has_the_colours_of_the_theme_and_prints_on_white(browser: Chromium, reference: Path) -> None:
    unfiltered(browser, reference)
    script = "(({ backgroundColor, color }) => [backgroundColor, color])(getComputedStyle(document.body))"

    def seen(theme: str, media: str = "screen") -> Any:
        features = [{"name": "prefers-color-scheme", "value": theme}]
        browser.call("Emulation.setEmulatedMedia", media=media, features=features)
        return browser.evaluate(script)

    assert seen("light") == seen("dark", "print") == ["rgb(255, 255, 255)", "rgb(28, 35, 41)"]
    assert seen("dark") == ["rgb(20, 24, 28)", "rgb(228, 233, 238)"]
    browser.call("Emulation.setEmulatedMedia", media="screen", features=[])


@pytest.mark.slow
def test_printed_pages_do_not_break_after_a_heading(browser: Chromium, reference: Path) -> None:
    unfiltered(browser, reference)
    script = "[...new Set([...document.querySelectorAll('h2, h3, h4')].map(one => getComputedStyle(one).breakAfter))]"
    browser.call("Emulation.setEmulatedMedia", media="print", features=[])
    try:
        assert browser.evaluate(script) == ["avoid"]
    finally:
        browser.call("Emulation.setEmulatedMedia", media="screen", features=[])
    assert browser.evaluate(script) == ["auto"]


@pytest.mark.slow
def test_a_narrow_window_shows_a_cue_where_columns_are_out_of_sight(browser: Chromium, reference: Path) -> None:
    unfiltered(browser, reference)
    cut = "new Promise((done) => setTimeout(done, 300)).then(() => document.querySelectorAll('.frame.cut').length)"
    sizes = {"height": 900, "deviceScaleFactor": 1, "mobile": False}
    browser.call("Emulation.setDeviceMetricsOverride", width=600, **sizes)
    assert browser.evaluate(cut) > 0
    assert browser.evaluate("document.documentElement.scrollWidth") <= 600
    browser.call("Emulation.setDeviceMetricsOverride", width=2400, **sizes)
    assert browser.evaluate(cut) == 0
    browser.call("Emulation.clearDeviceMetricsOverride")


def renamed(table: pd.DataFrame, names: dict[str, dict[str, str]]) -> pd.DataFrame:
    return table.replace({column: own for column, own in names.items() if column in table})


@pytest.mark.slow
def test_names_and_messages_are_displayed_as_plain_text(
    browser: Chromium, tmp_path: Path, reference_run: RunFrames
) -> None:
    attack = (
        '<img src=x onerror="window.hacked=1"></script><script>window.hacked=2</script>{{datum}}\'"`${window.hacked=3}'
    )
    plan = reference_run.info.plan
    names = {
        "problem": {"funnel-100": f"p{attack}"},
        "solver": {"NSGS": f"s{attack}"},
        "family": {"funnel": f"f{attack}"},
    }
    tables: dict[str, Any] = {
        name: renamed(getattr(reference_run, name), names) for name in ("cases", "points", "rounds", "iterations")
    }
    for column in ("reason", "stderr", "traceback", "model"):
        tables["cases"].loc[tables["cases"]["solver"] == f"s{attack}", column] = f"{column} {attack}"
    tables["cases"].loc[tables["cases"]["solver"] == f"s{attack}", "outcome"] = "crashed"
    swapped = msgspec.structs.replace(
        plan,
        problems=[names["problem"].get(name, name) for name in plan.problems],
        solvers=[names["solver"].get(name, name) for name in plan.solvers],
        families={names["problem"].get(name, name): family for name, family in plan.families.items()},
        suite=f"suite {attack}",
        left_out=[f"left out {attack}"],
    )
    info = msgspec.structs.replace(reference_run.info, plan=swapped, run_id=f"run {attack}")
    file = tmp_path / "report.html"
    file.write_text(page(replace(reference_run, info=info, **tables)), encoding="utf-8")
    opened(browser, file)
    go(browser, f"#{urlencode({'problem': f'p{attack}', 'case': f's{attack}'})}")
    text = browser.evaluate("document.body.textContent")
    for part in ("p", "s", "f", "run ", "suite ", "left out ", "stderr ", "traceback ", "reason ", "model "):
        assert f"{part}{attack}" in text
    assert browser.evaluate("window.hacked") is None
    assert browser.evaluate("document.querySelectorAll('img, iframe, object, embed').length") == 0
    assert browser.errors == []
    assert browser.requests == [file.as_uri()]


@pytest.mark.slow
def test_the_policy_of_the_page_stops_other_scripts_and_requests(browser: Chromium, reference: Path) -> None:
    unfiltered(browser, reference)
    script = """(() => { const one = document.createElement('script'); one.textContent = 'window.hacked = 1';
        document.body.append(one); return window.hacked ?? null; })()"""
    assert browser.evaluate(script) is None
    assert browser.evaluate("fetch('https://example.org').then(() => 'sent', () => 'stopped')") == "stopped"
    assert browser.evaluate("(() => { try { return eval('1'); } catch { return 'stopped'; } })()") == "stopped"


@pytest.mark.slow
def test_the_numbers_of_a_chart_are_saved_as_csv(
    browser: Chromium, reference: Path, reference_tables: dict[str, pd.DataFrame]
) -> None:
    unfiltered(browser, reference)
    save = """new Promise((done) => { URL.createObjectURL = (blob) => { blob.text().then(done); return '#summary'; };
        document.querySelector('#performance .tools button').click(); })"""
    lines = browser.evaluate(save).splitlines()
    assert lines[0] == "solver,ratio,share"
    assert len(lines) == 1 + len(profile_of(reference_tables, "performance"))
    assert not np.isnan(float(lines[1].rsplit(",", 1)[1]))
