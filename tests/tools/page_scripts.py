"""The scripts of a page, run by node without a browser, and the numbers that it holds for them."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
import zlib
from typing import Any

import pytest
from tools.waiting import FOREVER

from symphys.report.pages.markup import HERE, SCRIPTS, SHARED, START

NODE = pytest.mark.skipif(shutil.which("node") is None, reason="needs node to run the page's script")

STAGE = """
const gradient = () => ({ addColorStop() {} });
const pen = new Proxy({}, { get: (_, key) => (key.startsWith("create") ? gradient : () => {}), set: () => true });
const listeners = {};
const element = (name) => ({
  textContent: DATA, clientWidth: 800, clientHeight: 400, dataset: { view: name }, getContext: () => pen,
  setAttribute() {}, addEventListener: (kind, f) => { listeners[`${name} ${kind}`] = f; },
});
const names = ["canvas", ".play", ".controls input", ".controls output", "select", "script:not([data-film])"];
const parts = Object.fromEntries(names.map((name) => [name, element(name)]));
const views = ["space", "side", "top"].map(element);
let frames = 0;
global.window = { devicePixelRatio: 2, location: { hash: "" } };
global.document = {
  querySelectorAll: () => [{ querySelector: (name) => parts[name], querySelectorAll: () => views }],
  addEventListener: (kind, f) => { listeners[`document ${kind}`] = f; },
  dispatchEvent: (event) => listeners[`document ${event.type}`](event),
};
global.ResizeObserver = class { observe() {} };
global.requestAnimationFrame = (f) => { if (frames++ < 400) setImmediate(() => f(performance.now() + 100 * frames)); };
"""


def unpack(text: str) -> str:
    """The inverse of ``pack``."""
    return zlib.decompress(base64.b64decode(text)).decode()


def held(text: str, before: str) -> list[Any]:
    """The data that a page holds for its scripts behind each match of a pattern."""
    found = re.findall(rf'{before}.*?<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)
    return [json.loads(unpack(data)) for data in found]


def charts(text: str) -> dict[str, Any]:
    """The charts of a page by name, as its script reads them."""
    place = r'<figure class="chart" data-name='
    names = re.findall(rf'{place}"([\w-]+)"', text)
    return dict(zip(names, held(text, place), strict=True))


def run_script(code: str, *more: str) -> Any:
    """What an expression of the page's geometry, and of ``more`` scripts, gives."""
    names = ("geometry.js", "solids.js", "terrain.js", *more)
    script = "".join((HERE / name).read_text(encoding="utf-8") for name in names)
    done = subprocess.run(
        ["node", "-"],
        input=f"const document = {{ querySelectorAll: () => [] }};\n{script}\nconsole.log(JSON.stringify({code}));",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr == ""
    return json.loads(done.stdout)


def plays_to_the_end(motion: dict[str, Any]) -> None:
    """Look from all sides, go to the middle, then play: time, button and the terminal show that it went well."""
    data = json.dumps(json.dumps(motion))
    script = "".join((HERE / name).read_text(encoding="utf-8") for name in (*SHARED, *SCRIPTS, *START))
    acts = """
    for (const key of ["space click", "side click", "top click"]) listeners[key]();
    parts[".controls input"].value = "500";
    listeners[".controls input input"]();
    const half = parts[".controls output"].textContent;
    parts.select.value = "1";
    listeners[".play click"]();
    setImmediate(function shown() {
      if (frames < 400 && parts[".play"].textContent !== "▶") return setImmediate(shown);
      console.log(half, "|", parts[".controls output"].textContent, "|", parts[".play"].textContent);
    });
    """
    code = f"const DATA = {data};{STAGE}{script}{acts}"
    played = subprocess.run(["node", "-"], input=code, capture_output=True, text=True, timeout=FOREVER, check=False)
    assert played.stderr == ""
    half, end, button = played.stdout.strip().split(" | ")
    last = half.split(" / ")[1]
    assert float(half.split(" / ")[0]) == pytest.approx(float(last.rstrip(" s")) / 2, abs=0.01)
    assert end == f"{float(last.rstrip(' s')):.2f} / {last}"
    assert button == "▶"
