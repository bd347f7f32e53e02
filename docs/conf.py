"""Configuration of the documentation."""

from importlib import metadata

project = "Proxbench"
author = "The Proxbench developers"
release = metadata.version("proxbench")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["dollarmath", "amsmath"]
html_theme = "furo"
html_title = "Proxbench"
exclude_patterns = ["build"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
suppress_warnings = ["ref.python"]  # names that two packages export have two targets
