"""The page shows tolerances exactly, so that similar ones differ."""

from dataclasses import replace
from pathlib import Path

import msgspec
import pytest
from headless_chromium import Chromium, chromium
from proxbench.bench.report.page.assembly import page
from proxbench.bench.store.frames import RunFrames


@pytest.mark.skipif(
    not chromium(), reason="no Chromium is installed; put one on the path, or name it by PROXBENCH_CHROMIUM"
)
def test_similar_tolerances_differ_among_accuracies_and_in_cases(finished: RunFrames, tmp_path: Path) -> None:
    file, similar = tmp_path / "report.html", {1e-2: 1e-2, 1e-4: 1.23452e-4, 1e-6: 1.23451e-4}
    points = finished.points.assign(tolerance=finished.points["tolerance"].map(similar))
    plan = msgspec.structs.replace(finished.info.plan, tolerances=list(similar.values()))
    info = msgspec.structs.replace(finished.info, plan=plan)
    file.write_text(page(replace(finished, info=info, points=points), "SORprox"), encoding="utf-8")
    with Chromium() as browser:
        browser.open(file)
        choices = browser.evaluate("[...document.querySelectorAll('#filters option')].map((one) => one.textContent)")
        browser.evaluate("location.hash = '#problem=funnel-30&case=SORprox'")
        browser.evaluate("new Promise((done) => setTimeout(done, 300)).then(() => proxbench.render())")
        case = browser.evaluate("document.getElementById('case-view').textContent")
        assert browser.errors == []
    for text in ("1.23452e-4", "1.23451e-4"):
        assert text in choices
        assert text in case
