"""Short types in the reference: ``array_like`` in place of the four lines of numpy's alias."""

import re
from typing import Any

import numpy as np
from docutils import nodes
from numpy.typing import ArrayLike, NDArray
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.util.typing import stringify_annotation

_NAMES = {
    ArrayLike: "array_like",
    NDArray[np.float64]: "float array",
    NDArray[np.int64]: "int array",
    NDArray[np.int32]: "int array",
    NDArray[np.int8]: "int array",
    NDArray[np.bool_]: "bool array",
    NDArray[np.void]: "structured array",
}
_LONG = {stringify_annotation(kind, "smart"): name for kind, name in _NAMES.items()}
_LONG |= {stringify_annotation(kind, "fully-qualified-except-typing"): name for kind, name in _NAMES.items()}
_LONG |= {long.replace("~", "").replace("numpy.", ""): name for long, name in _LONG.items()}  # as properties show it


def _shortened(text: str) -> str:
    """Return types with short names of arrays, and of classes without their modules, which stay in the link."""
    for long, name in _LONG.items():
        text = text.replace(long, name)
    text = re.sub(r"(?<![~.\w])(?:collections\.abc|scipy)\.(?:\w+\.)*(\w+)", r"\1", text)
    return re.sub(r"(?<![~.\w])proxbench\.", "~proxbench.", text)


def _shorten(app: Sphinx, domain: str, objtype: str, content: nodes.Element) -> None:
    """Shorten the types of parameters, attributes, properties, and of what is returned."""
    for field in content.findall(nodes.field):
        if field[0].astext().startswith(("type ", "vartype ", "rtype")):
            for text in list(field[1].findall(nodes.Text)):
                text.parent.replace(text, nodes.Text(_shortened(text.astext())))
    assert content.parent is not None
    for signature in content.parent.findall(addnodes.desc_signature):
        for annotation in signature.findall(addnodes.desc_annotation):
            if any(long in annotation.astext() for long in _LONG):
                annotation[:] = [nodes.Text(_shortened(annotation.astext()))]


def _without_protocol_signature(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str, returns: str
) -> tuple[str, str] | None:
    """Leave out the signature of a protocol, which is never called."""
    return ("", "") if what == "class" and getattr(thing, "_is_protocol", False) else None


def setup(app: Sphinx) -> dict[str, bool]:
    """Shorten after autodoc has added the types."""
    app.connect("object-description-transform", _shorten, priority=900)
    app.connect("autodoc-process-signature", _without_protocol_signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
