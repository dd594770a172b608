"""Configuration of the documentation: `make docs` builds it into build/docs, without a network."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

from mbs.version import __version__  # noqa: E402

project = "mbs"
author = "mbs contributors"
copyright = author
release = version = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinxcontrib.bibtex",
    "docstrings",
    "mathml",
    "navigation",
    "sources",
]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_ext"]
root_doc = "index"
highlight_language = "text"
pygments_style = "friendly"
pygments_dark_style = "github-dark"
toc_object_entries_show_parents = "hide"

myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 4

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"
bibtex_reference_style = "author_year"

default_role = "literal"
nitpicky = True
nitpick_ignore = [("py:obj", "mbs.operations.PASSES")]  # a table of data
nitpick_ignore_regex = [("py:class", ".*")]  # annotations name classes of other packages
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {
    name: name for name in ("Array", "Vector", "Scalar", "Number", "Rotation", "Model", "Law")
}
autodoc_class_signature = "mixed"
autodoc_default_options = {"members": True}
maximum_signature_line_length = 88
napoleon_numpy_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
napoleon_attr_annotations = False
napoleon_custom_sections = [("Source", "notes_style")]

html_theme = "furo"
html_title = f"mbs {release}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["mbs.css"]
html_copy_source = False
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}
