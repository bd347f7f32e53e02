"""How charts look and are written: panels one below the other, as SVG and PNG, drawn without a browser."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

import altair as alt
import vl_convert

from .errors import BenchError
from .pictures import picture_files

PNG_SCALE = 2.0


def write_drawing(chart: alt.TopLevelMixin, path: Path) -> list[Path]:
    """Write a chart as ``path`` with .svg and with .png; return the files.

    Raises:
        BenchError: if they cannot be written.
    """
    svg, png = picture_files(path)
    with alt.data_transformers.enable("default", max_rows=None):  # altair's limit is meant for pages that are sent
        drawn = vl_convert.vegalite_to_svg(chart.to_json())
    try:
        svg.parent.mkdir(parents=True, exist_ok=True)
        svg.write_text(drawn, encoding="utf-8")
        png.write_bytes(vl_convert.svg_to_png(drawn, scale=PNG_SCALE))
    except OSError as error:
        raise BenchError(f"cannot write {error.filename or svg}: {error.strerror}; choose another place.") from None
    return [svg, png]


def stacked(
    panels: Sequence[alt.Chart | alt.LayerChart | alt.HConcatChart],
    title: alt.TitleParams,
    scales: Mapping[str, Literal["independent", "shared"]],
    spacing: int = 8,
    label: int = 52,
    **legend: Any,
) -> alt.VConcatChart:
    """Return panels one below the other.

    Args:
        panels: charts.
        title: of all of them.
        scales: whether the panels share them, by channel.
        spacing: between two panels [pixels].
        label: room left for the labels of vertical axes [pixels].
        legend: how the legend looks, beside its font.
    """
    chart: alt.VConcatChart = (
        alt.vconcat(*panels, spacing=spacing)
        .properties(title=title, background="white", padding=14)
        .configure_axis(labelFontSize=11, titleFontSize=12, titleFontWeight="normal", gridColor="#e8e8e8")
        .configure_axisY(minExtent=label)
        .configure_view(stroke="#cccccc")
        .configure_legend(labelFontSize=11, title=None, **legend)
        .resolve_scale(**scales)
    )
    return chart
