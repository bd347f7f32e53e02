"""LaTeX tables escape commands, and keep bold text and ties."""

import pandas as pd
from proxbench.bench.report.layout.text import latex_table


def test_texts_are_escaped_and_marks_become_commands() -> None:
    frame = pd.DataFrame({"solver": ["S(a_b='x')", "50 % & more"], "mean of\n6": ["**3 ms**", "≈ 4 ms"]})
    made = latex_table(frame)
    assert r"S(a\_b='x') & \textbf{3 ms} \\" in made
    assert r"50 \% \& more & $\approx$ 4 ms \\" in made
    assert "solver & mean of 6" in made
    assert made.startswith(r"\begin{tabular}")
