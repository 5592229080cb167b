"""The documentation site: `uv run --extra docs sphinx-build docs build/site`, then open it."""

import importlib.metadata

project = "tauguard"
author = "the tauguard authors"
release = importlib.metadata.version("tauguard")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
source_suffix = {".md": "markdown"}
myst_heading_anchors = 3
# Pages link to files of the repository, too, which are no pages of the site.
suppress_warnings = ["myst.xref_missing"]

autodoc_default_options = {"members": True, "imported-members": True}
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"  # fields of data classes: as attributes
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_use_ivar = True

html_theme = "pydata_sphinx_theme"
html_title = f"tauguard {release}"
html_show_sourcelink = False
html_static_path = ["style"]
html_css_files = ["narrow.css"]
html_sidebars = {"**": []}
html_theme_options = {
    "header_links_before_dropdown": 4,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
}
