"""HTML from small parts: every text is escaped unless it was made here."""

from __future__ import annotations

import base64
import hashlib
import html
import json
import re
import zlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path

from markdown_it import MarkdownIt

from symphys import files
from symphys.report.charts import palette
from symphys.report.charts.chart import Chart

VOID = frozenset({"br", "img", "input", "link", "meta"})
HERE = Path(__file__).parents[1] / "static"
SCRIPTS = ("geometry.js", "solids.js", "terrain.js", "painter.js", "joints.js", "animation.js")
SHARED, START, CHARTS, ROWS = ("numbers.js",), ("start.js",), ("charts.js",), ("rows.js",)
UNPACK, VIEWER = "unpack.js", "viewer.js"
ASSETS = "assets"
"""Folder of a batch for what its pages share."""
PACKED = "packed"
"""Class of what ``unpack.js`` unpacks."""
ICONS = {"good": "✓", "fair": "!", "bad": "✕", "unknown": "?"}


class Html(str):
    """A text that is HTML already; any other text is escaped before it enters a page."""

    __slots__ = ()


Part = str | Html


def safe(part: Part) -> Html:
    """Escape a text; leave HTML as it is."""
    return part if isinstance(part, Html) else Html(html.escape(part))


def join(parts: Iterable[Part]) -> Html:
    """Parts one after the other."""
    return Html("".join(safe(part) for part in parts))


def tag(name: str, /, *children: Part, **attributes: str | None) -> Html:
    """Return an element. ``class_`` stands for class, ``_`` for a hyphen; an attribute that is None is left out."""
    pairs = [(key.rstrip("_").replace("_", "-"), value) for key, value in attributes.items() if value is not None]
    opening = "".join([name, *(f' {key}="{html.escape(value)}"' for key, value in pairs)])
    return Html(f"<{opening}>" if name in VOID else f"<{opening}>{join(children)}</{name}>")


@cache
def renderer() -> MarkdownIt:
    """Return what makes HTML of Markdown: HTML in it is text, and nothing is loaded."""
    return MarkdownIt("commonmark", {"html": False}).disable(["image", "heading", "lheading"])


def markdown(text: str) -> Html:
    """Return a description, which may be Markdown."""
    return Html(renderer().render(text))


def card(title: str, *children: Part, anchor: str | None = None, note: Part = "") -> Html:
    """Return a section with a heading; nothing if there is nothing in it."""
    body = [child for child in children if child]
    if not body:
        return Html("")
    lead = [tag("p", note, class_="note")] if note else []
    return tag("section", tag("h2", title), *lead, *body, class_="card", id=anchor)


def table(header: Sequence[Part], rows: Iterable[Sequence[Part]], kinds: str, label: str = "") -> Html:
    """Return a table; ``kinds`` has one letter a column: ``t`` for text, ``n`` for a number."""
    classes = ["number" if kind == "n" else None for kind in kinds]
    head = [tag("th", cell, class_=kind, scope="col") for cell, kind in zip(header, classes, strict=True)]
    body = [tag("tr", *(tag("td", cell, class_=kind) for cell, kind in zip(row, classes, strict=True))) for row in rows]
    content = tag("table", tag("thead", tag("tr", *head)), tag("tbody", *body), aria_label=label or None)
    return tag("div", content, class_="scroll")


def pill(level: str, text: str) -> Html:
    """Return a short coloured word with a sign, so that colour is never alone."""
    return tag("span", tag("i", ICONS[level], aria_hidden="true"), text, class_=f"pill {level}")


def banner(level: str, title: str, *sentences: str) -> Html:
    """Return a coloured box with a sign, a title and what there is to say."""
    lines = [tag("p", sentence) for sentence in sentences if sentence]
    sign = tag("span", ICONS[level], class_="sign", aria_hidden="true")
    return tag("div", sign, tag("div", tag("b", title), *lines), class_=f"verdict {level}")


def dot(colour: str) -> Html:
    """Return a spot of a solver's or body's colour."""
    return tag("span", class_="dot", style=f"background:{palette.on_page(colour)}", aria_hidden="true")


def figures(charts: Iterable[Chart], caption: Part = "") -> Html:
    """Return charts, which the page's script draws, with one caption."""
    parts = [chart(each) for each in charts]
    if parts and caption:
        parts.append(tag("p", caption, class_="caption"))
    return join(parts)


def named_figure(charts: Mapping[str, Chart], name: str, caption: Part = "") -> Html:
    """Return the chart of that name, if there is one."""
    return figures([charts[name]] if name in charts else [], caption)


def chart(found: Chart) -> Html:
    """Return the place of a chart, and its numbers, compressed."""
    place = tag("div", role="img", aria_label=found.alt)
    return tag("figure", place, packed_json(found.to_json()), class_="chart", data_name=found.name)


def pack(text: str) -> str:
    """Compress a text: base64 of a zlib stream, which ``unpack.js`` unpacks in the browser."""
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode("ascii")


def packed_json(value: object, **attributes: str) -> Html:
    """Embed a value of strict JSON for scripts of the page, compressed; ``attributes``: more of its element."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return tag("script", Html(pack(text)), type="application/json", class_=PACKED, **attributes)


def stats(pairs: Iterable[tuple[str, str]]) -> Html:
    """Key numbers side by side."""
    return tag("dl", *(tag("div", tag("dt", key), tag("dd", value)) for key, value in pairs), class_="stats")


def facts(pairs: Iterable[tuple[str, Part]]) -> Html:
    """Show names and values below each other; those without a value are left out."""
    rows = [join([tag("dt", key), tag("dd", value)]) for key, value in pairs if value]
    return tag("dl", *rows, class_="facts") if rows else Html("")


def fold(title: str, text: str) -> Html:
    """Return a long text behind a line that opens it; nothing for an empty one."""
    return tag("details", tag("summary", title), tag("pre", text)) if text.strip() else Html("")


UNPACKED = tag(
    "p",
    "This browser cannot unpack the curves and the motion of this page; any browser of 2023 or later can.",
    class_="note unpacked",
    hidden="",
)
LOST = tag(
    "p",
    "The motion is played by a file in the folder “assets” of the batch, which is not there: “symphys report --single” "
    "of the run's folder writes a page that holds all.",
    class_="note lost",
    hidden="",
)
SCRIPTLESS = tag("noscript", tag("p", "Curves, motions and long tables need JavaScript.", class_="note"))


def page(title: str, body: Part, digest: str = "", viewer: str = "") -> str:
    """Return the whole document: no part of it is loaded from elsewhere, and no script but our own may run.

    The scripts are those that the body needs.

    Args:
        title: of the document.
        body: of it.
        digest: the checksum of what the page was made from.
        viewer: address of the script that plays motions, beside the page; empty to hold it in the page.
    """
    animated = "<canvas" in body
    first, then, packed = packed_scripts(animated, not viewer, 'class="chart"' in body, 'class="rows"' in body)
    if not then:
        return document(title, body, Html(""), (), digest)
    scripts, allowed = [tag("script", Html(packed), type="text/plain", class_=PACKED, id="scripts")], [first, then]
    if animated and viewer:
        body = join([LOST, body])
        scripts.append(tag("script", src=viewer))
    elif animated:
        scripts.append(tag("script", Html(packed_viewer()), type="text/plain", class_=PACKED, id="viewer"))
        allowed.append(read_static(VIEWER))
    scripts.append(tag("script", Html(first)))
    return document(title, join([UNPACKED, SCRIPTLESS, body]), join(scripts), allowed, digest, bool(viewer))


@cache
def packed_scripts(animated: bool, whole: bool, charts: bool, rows: bool) -> tuple[str, str, str]:
    """Return the script that unpacks, the script that it unpacks, and the latter compressed.

    ``whole``: what plays motions is part of it, and does not lie beside the page.
    """
    parts = (
        (SHARED, animated or charts or rows),
        (SCRIPTS, animated and whole),
        (START, animated),
        (CHARTS, charts),
        (ROWS, rows),
    )
    then = squeezed(read_static(*(name for names, wanted in parts if wanted for name in names)))
    return read_static(UNPACK), then, pack(then)


def squeezed(script: str) -> str:
    """Return the script without indentation and comments that end a line."""
    return "\n".join(filter(None, (re.sub(r"(^|\s+)// [^\"'`]*$", "", line).strip() for line in script.split("\n"))))


@cache
def packed_viewer() -> str:
    """Return the script that draws motions, compressed."""
    return pack(read_static(VIEWER))


def write_viewer(root: Path) -> str:
    """Write the script that plays motions into a folder, once for all of its pages; return its place in there."""
    text = f"{read_static(VIEWER)}\n{squeezed(read_static(*SCRIPTS))}\n"
    digest = hashlib.sha256(text.encode()).hexdigest()[:12]
    place = f"{ASSETS}/viewer-{digest}.js"
    if not (root / place).is_file():
        (root / ASSETS).mkdir(parents=True, exist_ok=True)
        files.write_text(root / place, text)
    return place


@cache
def read_static(*names: str) -> str:
    """Files of the page, one after the other."""
    return "".join((HERE / name).read_text(encoding="utf-8") for name in names)


def document(
    title: str,
    body: Part,
    scripts: Html,
    allowed: Collection[str],
    digest: str,
    beside: bool = False,
    asks: bool = False,
) -> str:
    """Return head and body.

    Args:
        title: of the document.
        body: of it.
        scripts: at its end.
        allowed: the texts of the scripts that may run.
        digest: the checksum of what the page was made from.
        beside: whether scripts beside the page may run too.
        asks: whether scripts may ask the server of the page.
    """
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii") for script in allowed]
    sources = " ".join(f"'sha256-{each}'" for each in hashes) or "'none'"
    more = " 'self' file:" if beside else ""
    policy = f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; script-src {sources}{more}"
    policy += "; connect-src 'self'" * asks
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="made-from", content=digest) if digest else "",
        tag("meta", http_equiv="Content-Security-Policy", content=policy),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("title", title),
        tag("style", Html(read_static("page.css"))),
    )
    return "<!doctype html>\n" + tag("html", head, tag("body", theme(), tag("main", body), scripts), lang="en") + "\n"


def theme() -> Html:
    """Return the switch between light and dark pages, which works without a script."""
    names = (("system", "System"), ("light", "Light"), ("dark", "Dark"))
    choices = []
    for key, title in names:
        checked = "" if key == "system" else None
        choices += [
            tag("label", tag("input", type="radio", name="theme", id=f"theme-{key}", checked=checked), f" {title}")
        ]
    return tag("fieldset", *choices, class_="theme", aria_label="Colours of the page")


def slug(text: str) -> str:
    """Return a name that is safe as a file name and as an anchor."""
    return re.sub(r"[^a-z0-9_]+", "-", text.lower()).strip("-")[:60] or "unnamed"
