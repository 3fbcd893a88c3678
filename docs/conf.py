"""Sphinx configuration of the documentation."""

project = "Slosh monitor"
author = "The slosh monitor's maintainers"
project_copyright = "the slosh monitor's maintainers, Apache-2.0"
release = "0.1.0"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "Slosh monitor"
autodoc_typehints = "description"
autodoc_member_order = "bysource"
# Types that come from NumPy and the standard library are not linked: the pages build offline.
nitpicky = False
