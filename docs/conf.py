"""The documentation site: `uv run --extra docs sphinx-build docs build/site`, then open it."""

import importlib.metadata
import os
import sys

if sys.platform == "linux" and "DISPLAY" not in os.environ:
    os.environ.setdefault("MUJOCO_GL", "egl")  # before MuJoCo is imported

project = "tauguard"
author = "the tauguard authors"
release = importlib.metadata.version("tauguard")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
myst_heading_anchors = 3
# Pages link to files of the repository, too, which are no pages of the site.
suppress_warnings = ["myst.xref_missing", "ref.term", "ref.ref"]  # the latter: of scikit-learn

autodoc_default_options = {"members": True, "imported-members": True}
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"  # fields of data classes: as attributes
autodoc_type_aliases = {"ArrayLike": "ArrayLike"}
autodoc_member_order = "bysource"
napoleon_numpy_docstring = False
napoleon_use_ivar = True


def _pictures_possible() -> bool:
    """Whether MuJoCo finds an OpenGL here."""
    try:
        import mujoco

        mujoco.GLContext(8, 8).free()
    except Exception:
        return False
    return True


_ALL, _WITHOUT_PICTURES = "/plot_", r"/plot_\d\d_(?!people|your_urdf)"
sphinx_gallery_conf = {
    "examples_dirs": "../examples/gallery",
    "gallery_dirs": "gallery",
    "filename_pattern": _ALL if _pictures_possible() else _WITHOUT_PICTURES,
    "within_subsection_order": "FileNameSortKey",
    "abort_on_example_error": True,
    "capture_repr": (),
    "show_memory": False,
}

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


def setup(app):
    """A colon before the text of attributes: napoleon takes "Words: more" for a type."""

    def begin(app, what, name, obj, options, lines):
        if what in ("attribute", "property", "data") and lines:
            lines[0] = f": {lines[0]}"

    app.connect("autodoc-process-docstring", begin, priority=400)  # before napoleon
