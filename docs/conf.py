"""Configuration of the documentation."""

import sys
from importlib import metadata
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "Proxbench"
author = "The Proxbench developers"
release = metadata.version("proxbench")
extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "command_help",
    "mathml",
    "plain_docstrings",
    "reference_run",
    "short_types",
]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = "Proxbench"
html_math_renderer = "mathml"
html_static_path = ["static"]
html_css_files = ["proxbench.css"]
html_copy_source = False
html_show_copyright = False
exclude_patterns = ["build"]
nb_execution_mode = "auto"  # notebooks are stored without outputs
nb_execution_timeout = 600
nb_execution_in_temp = True
nb_execution_raise_on_error = True
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
suppress_warnings = ["ref.python"]  # names that two packages export have two targets
