"""Equations as MathML, converted when the site is built: pages need no script and no network to show them."""

from typing import Any

from docutils import nodes
from math_core import LatexError, LatexToMathML
from sphinx.application import Sphinx
from sphinx.util import logging

_CONVERTER = LatexToMathML(fancy_error=False)
_LOGGER = logging.getLogger(__name__)


def _converted(node: nodes.Element, displaystyle: bool) -> str:
    """Return the equation of ``node``; a mistake in it is a warning of Sphinx, with its place."""
    try:
        converted: str = _CONVERTER.convert_with_local_state(node.astext(), displaystyle=displaystyle)
    except LatexError as error:
        _LOGGER.warning("cannot convert the equation %r: %s", node.astext(), error, location=node)
        return ""
    return converted


def _inline(translator: Any, node: nodes.math) -> None:
    translator.body.append(_converted(node, displaystyle=False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> None:
    translator.body.append(f'<div class="math">{_converted(node, displaystyle=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the renderer; ``html_math_renderer = "mathml"`` chooses it."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
