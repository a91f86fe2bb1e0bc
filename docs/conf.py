"""How Sphinx makes a site of the pages: `scripts/docs`, into `site/`. Nothing is fetched."""

from __future__ import annotations

import sys
from pathlib import Path

from sphinx.application import Sphinx

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from hil import __version__  # noqa: E402

project = "abreast"
release = version = __version__

# Pages lie where a code host shows them, so that every link between them works there and here.
root_doc = "docs/index"
include_patterns = ["docs/*.md", "CONTRIBUTING.md", "CHANGELOG.md"]
exclude_patterns = ["docs/conf.py"]

extensions = ["myst_parser", "sphinx.ext.autodoc"]
nitpicky = True
myst_heading_anchors = 4
# Types of annotations by their full names: what is not ours, and what is inside. Names in docstrings are
# looked up by tests/docs/test_names.py.
nitpick_ignore_regex = [
    ("py:.*", r"(numpy|os|collections|pathlib|typing|abc|msgspec)\..*"),
    ("py:.*", r"(formation|controllers|estimation|hil)\..*"),
]

autodoc_typehints = "description"
autodoc_member_order = "bysource"

highlight_language = "none"

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_title = "abreast"
html_copy_source = False
html_show_sourcelink = False
html_show_sphinx = False
html_show_copyright = False


def lead_to_the_pages(app: Sphinx, failure: Exception | None) -> None:
    """Write the front door of the site, as its pages lie one folder below."""
    if failure is None and app.builder.format == "html":
        pages = "docs/index.html"
        (Path(app.outdir) / "index.html").write_text(
            f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={pages}">'
            f'<title>abreast</title><a href="{pages}">abreast</a>\n',
            encoding="utf-8",
        )


def setup(app: Sphinx) -> None:
    """Join in with Sphinx."""
    app.connect("build-finished", lead_to_the_pages)
