"""Sphinx configuration of the documentation."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "Slosh monitor"
author = "The slosh monitor's maintainers"
project_copyright = "the slosh monitor's maintainers, Apache-2.0"
release = "0.1.0"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
html_math_renderer = "mathml"
exclude_patterns = ["_build"]
html_theme = "furo"
html_title = "Slosh monitor"
# An excerpt of each page that is found would be fetched, which a page from a file may not.
html_show_search_summary = False
html_favicon = "../src/slosh_bringup/slosh_bringup/watch/page/icon.svg"
html_static_path = ["static"]
html_css_files = ["pages.css"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
# Types that come from NumPy and the standard library are not linked: the pages build offline.
nitpicky = False
