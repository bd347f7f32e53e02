"""The report of a run: its tables, charts and page."""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from ...problems.representation import counted, html_table
from ..errors import BenchError, UnwritableError
from ..store.frames import JUDGED, RunFrames
from ..store.store import check_links_inside
from .accuracy import summary_table
from .profiles import COMMON, baseline_of, check_view
from .studies import points_table
from .tables import results_table, write_tables


@dataclass(frozen=True)
class Report:
    """The tables, charts and page of a run.

    Attributes:
        results: time to accuracy and ending of each case.
        summary: success and mean time of each solver; in a run over trajectories, its points.
        tables: the files of all tables.
        charts: the files of the charts; empty if none were drawn.
        page: the page; None if there is none.
        unwritten: a sentence about files that cannot be written; empty if all can.
    """

    results: pd.DataFrame
    summary: pd.DataFrame
    tables: list[Path]
    charts: list[Path]
    page: Path | None = None
    unwritten: str = ""

    def __repr__(self) -> str:
        counts = (counted(len(self.results), "case"), counted(len(self.tables), "table"))
        page = [f"page {self.page}"] if self.page else []
        unwritten = [self.unwritten] if self.unwritten else []
        return f"<Report: {', '.join([*counts, counted(len(self.charts), 'chart'), *page, *unwritten])}>"

    def _repr_html_(self) -> str:
        files = {"tables": self.tables, "charts": self.charts, "page": [self.page] if self.page else []}
        facts: dict[str, object] = {"cases": len(self.results)}
        facts |= {kind: ", ".join(map(str, paths)) for kind, paths in files.items() if paths}
        return html_table("Report", {**facts, **({"not written": self.unwritten} if self.unwritten else {})})


def build_report(frames: RunFrames, charts: bool, baseline: str, page: bool = False, profiles: str = COMMON) -> Report:
    """Write tables, charts and page of a run, and return them; see ``Run.report``.

    Args:
        frames: the run, with the residual that tables use.
        charts: draw charts.
        baseline: reference solver of speed-ups; if empty, the one that solves the most problems.
        page: write the page; studies and runs without cases have none.
        profiles: problems that charts of profiles cover, one of ``VIEWS``.

    Raises:
        BenchError: if a link in the folder of the run leads out of it, the solver or view is unknown, or ``baseline``
            is given for a run without speed-ups.
    """
    check_view(profiles)
    folder = frames.output_folder if frames.residual == JUDGED else frames.output_folder / frames.residual
    tables, chart_files, page_file, unwritten = [], [], None, ""
    has_profiles = len(frames.cases) > 0 and not frames.is_study
    if baseline and not has_profiles:
        raise BenchError(f"{frames.folder} has no speed-ups; omit `baseline`.")
    reference_solver = baseline_of(frames, baseline) if has_profiles else ""
    for subfolder in ("tables", "charts"):
        check_links_inside(folder / subfolder, frames.output_folder)
    try:
        tables = write_tables(frames, folder / "tables")
        if charts:
            from .charts.problems import write_charts  # altair takes a second to import
            from .charts.profiles import write_profiles

            chart_files = write_charts(frames, folder / "charts")
            chart_files += (
                write_profiles(frames, reference_solver, folder / "charts", profiles) if reference_solver else []
            )
        if page and has_profiles:
            from .page.assembly import write_page

            page_file = write_page(frames, reference_solver)
    except UnwritableError as error:
        unwritten = str(error)
    summary = points_table(frames) if frames.is_study else summary_table(frames)
    return Report(results_table(frames), summary, tables, chart_files, page_file, unwritten)
