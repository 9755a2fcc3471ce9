"""Settings of the documentation site; ``make docs`` builds it."""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from dataclasses import is_dataclass
from inspect import get_annotations
from pathlib import Path
from typing import Any, get_type_hints

from docutils.nodes import Element, Node, document, image, meta
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.inspect import TypeAliasForwardRef
from sphinx.util.logging import getLogger

import symphys
import symphys.model
import symphys.solvers

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "lessons"))
from notebook import write_notebooks  # noqa: E402

os.environ.setdefault("SYMPHYS_CACHE", str(ROOT / "build" / "kernels"))

project = "symphys"
author = "symphys contributors"
project_copyright = author
version = release = symphys.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
    "sphinx_design",
]
exclude_patterns = ["_static", "drawings"]
smartquotes = False  # --set is no dash
linkcheck_timeout = 20

# Markdown: formulas between dollars, and an anchor for every heading, so that links to headings are checked.
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4

# The notebook is run in a folder that is removed; a cell that fails ends the build.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

# The reference: names as users write them, types in the text, members in the order of the source.
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_member_order = "bysource"
autodoc_mock_imports = ["gymnasium", "jax", "torch"]
autodoc_preserve_defaults = True
TypeAliasForwardRef.__repr__ = lambda alias: alias.name  # Mapping[str, ArrayLike], not TypeAliasForwardRef('ArrayLike')
autodoc_type_aliases = {name: name for name in ("Array", "ArrayLike", "Source")}
napoleon_numpy_docstring = False
napoleon_use_ivar = True
# Types of other packages, and of the package's own rooms, which the page does not describe.
nitpick_ignore_regex = [
    ("py:class", "Array|ArrayLike|Figure|GuessedStates|Measure|Path|Record|RecordedRollout|Replay|Source"),
    ("py:.*", r"symphys\.[a-z_]+\..*"),
    ("py:.*", r"(collections|pathlib|types|typing|functools|enum|os)\..*"),
    ("py:.*", r"(casadi|ca|cma|gymnasium|jax|matplotlib|np|npt|numpy|pandas|pydantic|torch|xarray)\..*"),
]

# The theme and its colours; the logo and the favicon are drawings of this project.
html_theme = "furo"
html_title = f"symphys {release}"
html_static_path = ["_static"]
html_css_files = ["katex/katex.min.css", "symphys.css"]
html_js_files = ["gallery.js", ("katex/render.js", {"defer": "defer"})]
html_search_scorer = str(ROOT / "docs" / "_static" / "scorer.js")
# Formulas: a copy of KaTeX in _static/katex; the extension writes the elements, render.js sets them.
mathjax_path = "katex/katex.min.js"
html_logo = "_static/logo.svg"
html_favicon = "_static/favicon.svg"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#1f5f8b", "color-brand-content": "#1f5f8b"},
    "dark_css_variables": {"color-brand-primary": "#7fb8e0", "color-brand-content": "#7fb8e0"},
}
# The button of a console block copies the commands without their prompts and without what they print.
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True
copybutton_selector = "div:not(.highlight-text) > div.highlight pre"
html_show_copyright = False
html_show_sphinx = False
html_copy_source = False


PUBLIC = {*symphys.__all__, *symphys.model.__all__, *symphys.solvers.__all__}


def resolve_by_public_name(app: Sphinx, env: BuildEnvironment, node: pending_xref, content: Element) -> Node | None:
    """A reference to ``symphys.problem.problem.Problem`` leads to ``symphys.Problem``, which the page documents."""
    if node.get("refdomain") != "py":
        return None
    domain: Any = env.get_domain("py")
    name = str(node.get("reftarget", "")).rpartition(".")[2]
    for place in ("symphys", "symphys.model", "symphys.shooting", "symphys.solvers"):
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

    What a property is, and what a function returns, is a sentence, of which the part before a colon is no type; types
    are in annotations. Attributes that share a line, ``lower, upper: (n,)``, are no name with a type.
    """
    if what in ("attribute", "property"):
        for k, line in enumerate(lines):
            if line.startswith(":type: "):
                lines[0] = f"{line.removeprefix(':type: ')}: {lines[0]}"
                del lines[k]
                break
    returned = [k for k, line in enumerate(lines) if line.startswith((":returns: ", ":rtype: "))]
    if len(returned) == 2:
        said = lines.pop(returned[1]).removeprefix(":rtype: ")
        lines[returned[0]] = lines[returned[0]].replace(":returns: ", f":returns: {said}: ", 1)
    for k, line in enumerate(lines):
        shared = re.match(r":ivar (\w+(?:, \w+)+):", line)
        if shared:
            lines[k] = line.replace(shared[1], shared[1].replace(", ", "/"), 1)


def known_hints(described: type) -> dict[str, Any]:
    """Types of a class's fields; those that a module imports for type checkers alone are left out."""
    found: dict[str, Any] = {}
    for base in reversed(described.__mro__):
        for field, text in get_annotations(base).items():
            one = type("One", (), {"__annotations__": {field: text}, "__module__": base.__module__})
            with suppress(NameError):
                found |= get_type_hints(one, include_extras=True)
    return found


def show_shapes(app: Sphinx, what: str, name: str, described: object, options: object, lines: list[str]) -> None:
    """``Annotated[Array, "N, B, 3"]`` of a field becomes (N, B, 3); public classes go by their names alone."""
    hints = known_hints(described) if is_dataclass(described) and isinstance(described, type) else {}
    texts = {field: getattr(hint, "__metadata__", ("",))[0] for field, hint in hints.items()}
    shapes = {
        field: text if "," in text else f"{text}," for field, text in texts.items() if isinstance(text, str) and text
    }
    for k, line in enumerate(lines):
        field = re.match(r":ivar (\w+):", line)
        if field and field[1] in shapes:
            lines[k] = line.replace(field[0], f"{field[0]} ({shapes[field[1]]})", 1)
        if line.startswith(":vartype "):
            lines[k] = re.sub(r"\bsymphys\.[\w.]+\.(\w+)", lambda at: at[1] if at[1] in PUBLIC else at[0], line)


def leave_out_of_search(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Keep measurements and developers' pages out of the full-text search, so that it finds the guides first."""
    for page in env.found_docs:
        if page.startswith("results/") or page in ("architecture", "contributing"):
            env.metadata[page]["nosearch"] = "true"
    return []


SEARCHED = {
    "lessons/index": "tutorial, getting, started, learn, course, beginner",
    "installation": "install, setup, pip, conda, gcc, windows, macos",
    "faq": "questions, cite, citation, bibtex",
    "troubleshooting": "error, problem, fails, stuck, debug",
    "comparison": "alternatives, versus",
    "gallery": "examples, demos, shipped",
}
"""Words by which people search a page that does not contain them."""


def add_keywords(app: Sphinx, page: document) -> None:
    """Let the search find pages by other words than their own."""
    words = SEARCHED.get(app.env.docname)
    if words:
        page += meta(name="keywords", content=words)


def mark_light_figures(app: Sphinx, page: document) -> None:
    """Mark figures on white ground, which the dark theme inverts; drawings read on both themes as they are."""
    for figure in page.findall(image):
        if "drawings/" not in figure["uri"] and figure["uri"].endswith((".svg", ".png")):
            figure["classes"].append("on-white")


def write_lessons(app: Sphinx) -> None:
    """Write the notebooks of the lessons; a picture that is missing is a warning, as elsewhere."""
    try:
        write_notebooks(app)
    except FileNotFoundError as missing:
        getLogger(__name__).warning("no notebooks of the lessons: %s", missing)


def setup(app: Sphinx) -> None:
    """Add what Sphinx has no option for; napoleon reads docstrings at priority 500."""
    app.connect("builder-inited", write_lessons)
    app.connect("doctree-read", add_keywords)
    app.connect("doctree-read", mark_light_figures)
    app.connect("env-updated", leave_out_of_search)
    app.connect("missing-reference", resolve_by_public_name)
    app.connect("autodoc-process-docstring", keep_bars, priority=400)
    app.connect("autodoc-process-docstring", keep_sentences, priority=600)
    app.connect("autodoc-process-docstring", show_shapes, priority=700)
