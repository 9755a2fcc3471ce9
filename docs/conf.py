"""The site: Markdown pages of this folder, the notebook, and the reference of the package; ``make docs`` builds it."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from docutils.nodes import Element, Node
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

import symphys

ROOT = Path(__file__).parents[1]
os.environ.setdefault("SYMPHYS_CACHE", str(ROOT / "build" / "kernels"))

project = "symphys"
author = "symphys contributors"
project_copyright = author
version = release = symphys.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["README.md"]

# Markdown: formulas between dollars, and an anchor for every heading, so that links to headings are checked.
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

# The notebook is run when it has changed; a cell that fails ends the build. What it writes goes to a folder of its own.
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build" / "notebooks")
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

# The reference: names as users write them, types in the text, members in the order of the source.
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
# Types of other packages, and of the package's own rooms, which the page does not describe.
nitpick_ignore_regex = [
    ("py:.*", r"symphys\.(codegen|dynamics|model|problem|results|solvers\.core|transcription)\..*"),
    ("py:.*", r"(collections|pathlib|types|typing|functools|enum|os)\..*"),
    ("py:.*", r"(casadi|ca|matplotlib|numpy|np|npt|pandas|pydantic|xarray|cma)\..*"),
]

# Fonts and styles lie in the site; only pages with formulas ask for MathJax on the network.
html_theme = "furo"
html_title = f"symphys {release}"
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False


def resolve_by_public_name(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: Element) -> Node | None:
    """A reference to ``symphys.problem.problem.Problem`` leads to ``symphys.Problem``, which the page documents."""
    if node.get("refdomain") != "py":
        return None
    domain: Any = env.get_domain("py")
    name = str(node.get("reftarget", "")).rpartition(".")[2]
    for place in ("symphys", "symphys.solvers"):
        if f"{place}.{name}" in domain.objects:
            arguments = (env, node.get("refdoc", ""), app.builder, "obj", f"{place}.{name}", node, content)
            found: Node | None = domain.resolve_xref(*arguments)
            return found
    return None


def keep_bars(app: Sphinx, what: str, name: str, described: object, options: object, lines: list[str]) -> None:
    """``|merit|`` in a docstring is a norm, not a substitution; code in backquotes stays as it is."""
    for k, line in enumerate(lines):
        lines[k] = re.sub(r"(``.*?``)|\|", lambda found: found[1] or r"\|", line)


def keep_sentences(app: Sphinx, what: str, name: str, described: object, options: object, lines: list[str]) -> None:
    """Undo what napoleon makes of colons and commas.

    The docstring of a property is a sentence, of which the part before a colon is no type; and attributes that share
    a line, ``lower, upper: (n,)``, are no name with a type.
    """
    if what in ("attribute", "property"):
        for k, line in enumerate(lines):
            if line.startswith(":type: "):
                lines[0] = f"{line.removeprefix(':type: ')}: {lines[0]}"
                del lines[k]
                break
    for k, line in enumerate(lines):
        shared = re.match(r":ivar (\w+(?:, \w+)+):", line)
        if shared:
            lines[k] = line.replace(shared[1], shared[1].replace(", ", "/"), 1)


def setup(app: Sphinx) -> None:
    """Add what Sphinx has no option for; napoleon reads docstrings at priority 500."""
    app.connect("missing-reference", resolve_by_public_name)
    app.connect("autodoc-process-docstring", keep_bars, priority=400)
    app.connect("autodoc-process-docstring", keep_sentences, priority=600)
