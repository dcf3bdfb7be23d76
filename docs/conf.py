"""The site: written pages, and pages made of pictures, ledger and docstrings (`pages`)."""

from __future__ import annotations

import re
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE)]

import examples  # noqa: E402
import pages  # noqa: E402
from docutils import nodes  # noqa: E402
from docutils.parsers.rst import Directive  # noqa: E402

from derivations import report  # noqa: E402
from tensegrity import __version__  # noqa: E402

project = "tensegrity"
author = "The tensegrity developers"
copyright = author
release = __version__
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_copybutton",
]
exclude_patterns = ["_build", "_made", "live", "pictures"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
default_role = "code"
autodoc_typehints = "none"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_xref_param_type = False
copybutton_selector = ":not(.output) > div.highlight pre"
copybutton_prompt_text = r">>> |\.\.\. "
copybutton_prompt_is_regexp = True
html_theme = "pydata_sphinx_theme"
html_title = "tensegrity"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_sourcelink_suffix = ""
html_theme_options = {
    "navbar_align": "left",
    "navbar_persistent": ["search-button"],
    "header_links_before_dropdown": 8,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "show_prev_next": False,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
}
html_context = {"default_mode": "auto"}
WITHOUT = (
    "index",
    "live",
    "claims",
    "derivations",
    "limits",
    "accuracy",
    "conventions",
    "speed",
    "house",
    "extend",
    "cite",
    "gallery/*",
)
html_sidebars = {page: [] for page in WITHOUT}  # of the pages of their part


class Formula(Directive):
    """Formulas of the ledger, by their names: ```{formula} talk.sech2, talk.gamma."""

    required_arguments = 1
    final_argument_whitespace = True

    def run(self):
        try:
            html = [report.formula(name.strip()) for name in self.arguments[0].split(",")]
        except ValueError as error:
            raise self.error(str(error)) from None
        return [nodes.raw("", "\n".join(html), format="html")]


def drop_dead_links(app, page, template, context, doctree):
    """Links from the code of an object back to where it is documented, by another name perhaps."""
    if page.startswith("_modules/"):
        known = app.env.domaindata["py"]["objects"]
        context["body"] = re.sub(
            r'<a class="viewcode-back" href="[^"#]*#([^"]+)">.*?</a>',
            lambda link: link[0] if link[1] in known else "",
            context["body"],
        )


def setup(app):
    """Pages are made, and examples run, before the first is read; formulas are linked as docstrings
    are."""
    app.add_directive("formula", Formula)
    app.connect("builder-inited", lambda app: pages.make(Path(app.srcdir)))
    app.connect("builder-inited", lambda app: examples.run_all(Path(app.srcdir)))
    app.connect("source-read", examples.add_results)
    app.connect("autodoc-process-docstring", pages.link_formulas)
    app.connect("html-page-context", drop_dead_links)
    app.connect("build-finished", lambda app, _: pages.copy_live(Path(app.outdir)))
