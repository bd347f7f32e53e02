"""Files that the page saves guard the same texts against execution as the tables of a report."""

import json
from importlib import resources

import pandas as pd
import pytest
from headless_chromium import Chromium, chromium
from proxbench.bench.report import page
from proxbench.bench.report.layout.text import FORMULA_STARTS, csv_content

pytestmark = pytest.mark.skipif(
    not chromium(), reason="no Chromium is installed; put one on the path, or name it by PROXBENCH_CHROMIUM"
)


@pytest.mark.slow
def test_a_saved_file_has_the_content_of_a_table() -> None:
    script = (resources.files(page) / "elements.js").read_text(encoding="utf-8")
    starts = [*FORMULA_STARTS, "\r", "\r\n", "'", "x"]
    texts = [f"{start}{rest}" for start in starts for rest in ("=1", "SUM(A1)", '1,"2"')]
    texts += ["-1.5", "+1e-3", "a\r=1", "a\r\n=1"]
    with Chromium() as browser:
        rows = json.dumps([{"text": text, "number": -1} for text in texts])
        saved = browser.evaluate(f"(() => {{ {script}; return csv({rows}); }})()")
    assert saved.encode() == csv_content(pd.DataFrame({"text": texts, "number": -1}))
