"""Blank pictures in place of drawn charts, for tests of the files that commands write; other tests draw each chart."""

import base64
from types import SimpleNamespace

import pytest
from proxbench.bench.report.charts import drawing

SVG = '<svg xmlns="http://www.w3.org/2000/svg" width="1" height="1"/>'
PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGP4////fwAJ+wP9CNHoHgAAAABJRU5ErkJggg=="
)


def draw_blank_pictures(patch: pytest.MonkeyPatch) -> None:
    """Replace the program that draws charts; their specifications are still made."""
    program = SimpleNamespace(
        vegalite_to_vega=drawing.vl_convert.vegalite_to_vega,
        vegalite_to_svg=lambda specification: SVG,
        svg_to_png=lambda svg, scale: PNG,
    )
    patch.setattr(drawing, "vl_convert", program)
