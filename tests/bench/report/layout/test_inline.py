"""Text in cells of tables."""

from proxbench.bench.report.layout.text import inline


def test_multiline_text_becomes_one_table_cell() -> None:
    assert inline("no memory\n  in <line>\r\n\r\n2 | 3") == r"no memory in &lt;line&gt; 2 \| 3"
