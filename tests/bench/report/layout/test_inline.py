"""Text in cells of tables."""

from proxbench.bench.report.layout.text import inline


def test_a_text_of_several_lines_stays_in_its_cell() -> None:
    assert inline("no memory\n  in <line>\r\n\r\n2 | 3") == r"no memory in &lt;line&gt; 2 \| 3"
