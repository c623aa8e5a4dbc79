"""How `make docs` builds these pages: offline, and a warning is an error."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

import hqp_rp  # noqa: E402

project = "hqp_rp"
author = "The hqp_rp developers"
version = release = hqp_rp.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "public_names",
]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_ext", "_static", "figures"]

highlight_language = "text"  # a formula is no program

html_theme = "furo"
html_title = f"hqp_rp {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_show_copyright = False

myst_heading_anchors = 4

autodoc_typehints = "signature"
# Shown by their names, which are in docs/notation.md, and not by what they stand for.
autodoc_type_aliases = {
    name: name
    for name in ("ArrayLike", "FloatArray", "IntArray", "Item", "PerJoint", "StackMetric", "LevelDamping", "Feedback")
}
autodoc_typehints_format = "short"
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
python_maximum_signature_line_length = 88
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_custom_sections = [("Settings", "params_style")]
napoleon_use_rtype = False
napoleon_attr_annotations = False  # the constructor's signature has them

copybutton_exclude = ".linenos, .gp, .go"

# Every reference inside these pages must resolve. Types of other packages and type aliases have no page here, and one of
# the other packages' own is a network away.
nitpicky = True
nitpick_ignore_regex = [
    ("py:.*", r"(?!hqp_rp\.[A-Z]).*"),
]

# The type of an attribute whose name several classes share.
suppress_warnings = ["ref.python"]

# `make links` visits these; `make docs` never leaves the machine.
linkcheck_timeout = 20
linkcheck_workers = 4
