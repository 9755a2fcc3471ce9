"""The common style of the drawings: SVG with texts as text, in tones that read on light and on dark pages.

A drawing is a `Drawing` of a width and a height in pixels, with the origin at the top left and y downwards. Colours are
of middle lightness, with a contrast of 4 to 1 or more on white and on the dark background of the site, because an image
cannot see the theme of its page. `docs/drawings/make.py` writes all drawings.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from html import escape
from math import hypot

INK = "#757b85"
"""Lines and texts."""
BLUE = "#2b7fc4"
"""First accent: motion, velocities, the result."""
ORANGE = "#cc5f14"
"""Second accent: contact, impulses, what the text is about."""
FONT = "ui-sans-serif, system-ui, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif"
MONO = "ui-monospace, 'Cascadia Mono', Menlo, Consolas, monospace"
SIZE = 14
"""Size of texts [px]; small texts are 12."""

Point = tuple[float, float]


def number(value: float) -> str:
    """Return a coordinate with one decimal at most."""
    return f"{round(value, 1):g}"


class Drawing:
    """An SVG picture that is put together from lines, shapes and texts.

    Attributes:
        width, height: [px].
        title: one sentence, which screen readers read.
    """

    def __init__(self, width: float, height: float, title: str) -> None:
        """Begin an empty picture."""
        self.width, self.height, self.title = width, height, title
        self._parts: list[str] = []

    def _add(self, name: str, body: str = "", **attributes: object) -> None:
        pairs = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
        texts = " ".join(
            f'{key}="{number(value) if isinstance(value, (int, float)) else escape(str(value))}"'
            for key, value in pairs.items()
        )
        self._parts.append(f"<{name} {texts}>{body}</{name}>" if body else f"<{name} {texts}/>")

    def line(self, *points: Point, colour: str = INK, width: float = 1.5, dash: bool = False) -> None:
        """Draw straight lines through points."""
        path = " ".join(f"{number(x)},{number(y)}" for x, y in points)
        self._add("polyline", points=path, fill="none", stroke=colour, stroke_width=width, **_dashes(dash))

    def path(
        self, d: str, colour: str = INK, width: float = 1.5, dash: bool = False, fill: str = "none", shade: float = 1
    ) -> None:
        """Draw a path of SVG, such as "M 10 20 Q 30 0 50 20"; `shade` is the opacity of the filling."""
        stroke = "none" if width == 0 else colour
        filling = {"fill_opacity": f"{shade:g}"} if fill != "none" else {}
        self._add("path", d=d, fill=fill, stroke=stroke, stroke_width=width or None, **filling, **_dashes(dash))

    def curve(self, points: Sequence[Point], colour: str = BLUE, width: float = 2, dash: bool = False) -> None:
        """Draw a sampled curve."""
        self.line(*points, colour=colour, width=width, dash=dash)

    def arrow(
        self, start: Point, end: Point, colour: str = INK, width: float = 1.8, head: float = 8, dash: bool = False
    ) -> None:
        """Draw an arrow from start to end; `head` is the length of its head [px]."""
        (x0, y0), (x1, y1) = start, end
        length = hypot(x1 - x0, y1 - y0)
        ux, uy = (x1 - x0) / length, (y1 - y0) / length
        bx, by = x1 - head * ux, y1 - head * uy
        self.line(start, (bx, by), colour=colour, width=width, dash=dash)
        side = 0.45 * head
        corners = ((x1, y1), (bx - side * uy, by + side * ux), (bx + side * uy, by - side * ux))
        self._add("polygon", points=" ".join(f"{number(x)},{number(y)}" for x, y in corners), fill=colour)

    def circle(
        self, centre: Point, radius: float, colour: str = INK, width: float = 1.5, fill: str = "none", shade: float = 1
    ) -> None:
        """Draw a circle; `fill` is the colour inside, and `shade` its opacity."""
        filling = {"fill_opacity": f"{shade:g}"} if fill != "none" else {}
        self._add(
            "circle", cx=centre[0], cy=centre[1], r=radius, fill=fill, stroke=colour, stroke_width=width, **filling
        )

    def dot(self, centre: Point, colour: str = INK, radius: float = 3.5) -> None:
        """Draw a filled point."""
        self._add("circle", cx=centre[0], cy=centre[1], r=radius, fill=colour)

    def box(
        self,
        corner: Point,
        width: float,
        height: float,
        colour: str = INK,
        fill: str | None = None,
        shade: float = 0.12,
        round_: float = 6,
        turn: float = 0,
    ) -> None:
        """Draw a rectangle from its top left corner; `turn` [degrees] turns it clockwise about its centre."""
        x, y = corner
        about = f"rotate({turn:g} {number(x + width / 2)} {number(y + height / 2)})" if turn else None
        self._add(
            "rect",
            x=x,
            y=y,
            width=width,
            height=height,
            rx=round_,
            fill=fill or colour,
            fill_opacity=f"{shade:g}",
            stroke=colour,
            stroke_width=1.5,
            transform=about,
        )

    def ground(self, y: float, x0: float, x1: float, colour: str = INK) -> None:
        """Draw the surface of the ground, with hatching below it."""
        self.line((x0, y), (x1, y), colour=colour, width=2)
        marks = " ".join(f"M {number(x)} {number(y)} l -8 8" for x in range(int(x0) + 12, int(x1), 14))
        self._add("path", d=marks, stroke=colour, stroke_width=1, stroke_opacity="0.6")

    def text(
        self,
        at: Point,
        words: str,
        colour: str = INK,
        size: float = SIZE,
        anchor: str = "start",
        bold: bool = False,
        italic: bool = False,
        mono: bool = False,
    ) -> None:
        """Write a line of text with its baseline at a point.

        `v_k` becomes a subscript and `v^2` a superscript; several letters are put into braces: `t_{k+1}`. Text in a
        typewriter face (`mono`) stays as it is. `anchor`: "start", "middle" or "end".
        """
        self._add(
            "text",
            escape(words) if mono else _marked_up(words),
            x=at[0],
            y=at[1],
            fill=colour,
            font_size=size if size != SIZE else None,
            text_anchor=anchor if anchor != "start" else None,
            font_weight="600" if bold else None,
            font_style="italic" if italic else None,
            font_family=MONO if mono else None,
        )

    def lines(self, at: Point, words: Sequence[str], step: float = 18, **options: object) -> None:
        """Write several lines of text, `step` [px] apart."""
        for k, line in enumerate(words):
            self.text((at[0], at[1] + k * step), line, **options)  # type: ignore[arg-type]

    def svg(self) -> str:
        """Return the picture."""
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {number(self.width)} {number(self.height)}" '
            f'width="{number(self.width)}" height="{number(self.height)}" role="img" '
            f'font-family="{FONT}" font-size="{SIZE}">\n<title>{escape(self.title)}</title>\n'
        )
        return head + "\n".join(self._parts) + "\n</svg>\n"


def _dashes(dash: bool) -> dict[str, str]:
    return {"stroke_dasharray": "5 4"} if dash else {}


def _marked_up(words: str) -> str:
    """Return XML with sub- and superscripts, each of which the next piece of text takes back."""
    pieces = re.split(r"([_^](?:\{[^}]*\}|\w))", words)
    found, shift = [], 0
    for piece in pieces:
        if re.match(r"[_^](\{|\w)", piece):
            shift = 4 if piece[0] == "_" else -6
            found.append(f'<tspan dy="{shift}" font-size="75%">{escape(piece[1:].strip("{}"))}</tspan>')
        elif piece:
            back = f' dy="{-shift}"' if shift else ""
            found.append(f"<tspan{back}>{escape(piece)}</tspan>" if shift else escape(piece))
            shift = 0
    return "".join(found)
