"""A page in a headless Chromium: what a script sees in it, and what the browser complains of."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from tools.waiting import FOREVER

from symphys.report.making.video import BROWSERS

CHROMIUM = next(filter(None, map(shutil.which, BROWSERS)), None)
BROWSER = pytest.mark.skipif(CHROMIUM is None, reason="needs chromium to open pages (Debian: apt-get install chromium)")
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
GPU = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""WebGL without a graphics processor."""
FLAGS = ("--headless", "--no-sandbox", *GPU, "--hide-scrollbars", "--enable-logging=stderr", "--v=0")
ASK = """
<iframe id="page" style="width:WIDTHpx;height:900px;border:0" srcdoc="PAGE"></iframe>
<script>
const frame = document.getElementById("page");
frame.onload = () => setTimeout(() => {
  const window = frame.contentWindow, document = frame.contentDocument;
  let seen;
  try { seen = (() => { SCRIPT })(); } catch (error) { seen = `failed: ${error}`; }
  const place = globalThis.document.createElement("pre");
  place.id = "seen";
  place.textContent = JSON.stringify(seen);
  globalThis.document.body.append(place);
}, 1500);
</script>
"""


@dataclass(frozen=True)
class Visit:
    """What a script returned, and the messages of the page's console."""

    seen: Any
    console: list[str]


def visit(
    page: Path, script: str, width: int = 1400, dark: bool = False, printed: bool = False, flat: bool = False
) -> Visit:
    """Open a page in a frame of some width and return what ``script``, the body of a function, gives there.

    ``printed``: as on paper; ``flat``: without WebGL.
    """
    text = POLICY.sub("", page.read_text("utf-8"))
    text = text.replace("@media print", "@media all") if printed else text
    asking = ASK.replace("WIDTH", str(width)).replace("SCRIPT", script).replace("PAGE", html.escape(text))
    wrapper = page.with_name(f"asked-{width}.html")
    wrapper.write_text(f"<!doctype html><html><body>{asking}</body></html>", encoding="utf-8")
    assert CHROMIUM is not None
    more = ["--force-dark-mode"] * dark + ["--disable-3d-apis"] * flat
    call = [CHROMIUM, *FLAGS, *more, "--dump-dom", "--virtual-time-budget=8000", wrapper.resolve().as_uri()]
    done = subprocess.run(call, capture_output=True, text=True, timeout=FOREVER, check=False)
    wrapper.unlink()
    found = re.search(r'<pre id="seen">(.*?)</pre>', done.stdout, re.DOTALL)
    assert found is not None, done.stderr[-2000:]
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return Visit(json.loads(html.unescape(found.group(1))), console)
