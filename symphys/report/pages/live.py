"""The page of a batch while it is solved; a script asks for its state, once a second."""

from __future__ import annotations

from functools import cache

from symphys.report.charts import palette
from symphys.report.pages.markup import CHARTS, SHARED, Html, document, join, read_static, squeezed, tag

LIVE = "live.js"


@cache
def live_page() -> str:
    """Return the page, which is the same for every batch."""
    colours = [palette.on_page(colour) for colour in palette.BODIES]
    script = squeezed(read_static(*SHARED, *CHARTS, LIVE)).replace('"COLOURS"', str(colours).replace("'", '"'))
    body = join(
        [
            tag("p", "While it is solved", class_="kicker"),
            tag("h1", "…", id="title"),
            tag("p", "", class_="lead", id="note"),
            tag("section", tag("h2", "Runs"), tag("ul", id="runs", class_="keys"), class_="card"),
            tag("section", tag("h2", "Convergence"), tag("figure", id="curves"), class_="card"),
        ]
    )
    return document("symphys: live", body, tag("script", Html(script)), (script,), "", asks=True)
