"""The documentation site: `make docs` builds it into docs/_build/html, without network.

The source directory is the repository itself, so that a link between two pages is the same relative path on the site
and in a checkout. What can be read from the code is made by `docs/from_code.py` while the site is built.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import toolpath_stiff  # noqa: E402

project = "toolpath_stiff"
author = "the authors of toolpath_stiff"
copyright = author
version = release = toolpath_stiff.__version__
language = "en"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "local_math",
    "from_code",
]
root_doc = "docs/index"
include_patterns = [
    "docs/**.md",
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "benchmarks/*.md",
    "programs/README.md",
    "reports/README.md",
    "reports/case_study/case_study.md",
]
exclude_patterns = ["**/.*", ".venv", "build", "dist", "docs/_*", "**/__pycache__", "**/.ipynb_checkpoints"]

# Markdown as GitHub reads it, and what the landing page needs.
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_dmath_double_inline = True
suppress_warnings = [
    "myst.header",  # a README may begin with a picture
    "misc.highlighting_failure",  # shown TOML leaves lines out with ...
]
highlight_language = "none"
smartquotes = False  # --out is not a dash
html_math_renderer = "mathml"

nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_show_tb = True
nb_merge_streams = True

# Numpy docstrings; in them `code` stands between single backticks.
default_role = "literal"
napoleon_google_docstring = False
napoleon_use_rtype = False
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autosummary_generate = False

html_theme = "pydata_sphinx_theme"
html_title = "toolpath_stiff"
html_static_path = ["_static"]
html_extra_path = ["_extra"]  # index.html, which leads to docs/index.html
html_css_files = ["site.css"]
html_show_sourcelink = False
html_copy_source = False
html_show_copyright = False
html_context = {"default_mode": "auto"}  # the theme's script asks for it
html_sidebars = {"docs/index": []}
html_theme_options = {
    "header_links_before_dropdown": 7,
    "navigation_with_keys": False,
    "show_prev_next": True,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": [],
    "footer_end": [],
    "navbar_align": "left",
    "pygments_light_style": "default",
    "pygments_dark_style": "github-dark",
}
