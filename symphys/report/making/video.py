"""A motion as a moving picture: a browser draws its frames, as a page does, and Pillow joins them.

The browser is an installed Chromium, which runs without a window. Pillow comes with matplotlib.
"""

from __future__ import annotations

import base64
import html
import io
import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from symphys import files
from symphys.report.pages.markup import page
from symphys.report.pages.run import film_of, read_recorded
from symphys.report.scene.animation import animation
from symphys.results.text_files import ReportError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--hide-scrollbars",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--virtual-time-budget=4000",
    "--dump-dom",
)
KINDS = {".webp": "WEBP", ".gif": "GIF", ".png": "PNG"}
"""Moving pictures by the ending of a file's name."""
SIZE = 640, 360
"""[px]"""
RATE = 16
"""Frames a second."""
LONGEST, LEAST_SECONDS, MOST_SECONDS = 160, 3.0, 8.0
"""Frames at most; [s] that a motion takes at least and at most."""
FILM_SECONDS = 3.0
"""[s] that the film of a solve takes before the motion."""
TIMEOUT = 300.0
"""[s] that a browser may take."""
WAYS = (62, 1, 1.0), (45, 1, 0.75), (40, 2, 0.75), (30, 2, 0.6)
"""Quality, which frames, and share of the size: the first that gives at most ``MOST_BYTES``."""
MOST_BYTES = 400_000
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
RECORD = """
<script>
const wait = setInterval(() => {
  const root = document.querySelector(".animation"), player = root && root.player;
  if (!player) return;
  clearInterval(wait);
  Object.assign(player.canvas.style, { width: "WIDTHpx", height: "HEIGHTpx", border: "0", borderRadius: "0" });
  player.stage?.resize();
  player.look(player.view);
  const take = () => { player.stage?.render(); return player.canvas.toDataURL("image/png"); }, taken = [];
  const slider = FILM && player.film?.querySelector("input");
  if (slider) {
    const count = Number(slider.max);
    for (let k = 0; k < FILM; k++) {
      slider.value = String(Math.round(k * count / (FILM - 1)));
      slider.dispatchEvent(new Event("input"));
      player.go(player.last);
      taken.push(take());
    }
  }
  for (let k = 0; k < FRAMES; k++) {
    player.go(player.first + (player.last - player.first) * k / (FRAMES - 1));
    taken.push(take());
  }
  const place = document.createElement("pre");
  place.id = "taken";
  place.textContent = JSON.stringify(taken);
  document.body.replaceChildren(place);
}, 50);
</script>
"""


def write_video(run_dir: Path, out: Path, film: bool = False) -> Path:
    """Write the motion of a run folder as a moving picture that plays over and over.

    Args:
        run_dir: a run folder with a motion.
        out: the file; its name ends in .webp, .gif or .png.
        film: whether motions from the guess to the result come first, where the run has them.

    Raises:
        ReportError: there is no motion, no browser, or no such kind of file.
    """
    if out.suffix.lower() not in KINDS:
        raise ReportError(f"{out}: a moving picture ends in {', '.join(KINDS)}")
    run, recording = read_recorded(run_dir)
    motion = recording.trajectory
    if motion is None:
        raise ReportError(f"{run_dir}: there is no motion to draw: {'; '.join(recording.faults)}")
    lasting = min(max(float(motion.time[-1] - motion.time[0]), LEAST_SECONDS), MOST_SECONDS)
    counts = round(RATE * FILM_SECONDS) if film else 0, min(round(RATE * lasting), LONGEST)
    shown = animation(motion, recording.scene, recording.guess, film=film_of(run, motion) if film else None)
    pictures = drawn(page(run.title, shown), *counts)
    files.write_bytes(out, joined(pictures, KINDS[out.suffix.lower()]))
    return out


def drawn(text: str, film: int, frames: int) -> list[bytes]:
    """Return the frames of a page's motion as PNG files; ``film``: how many of them are of the solve."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise ReportError("moving pictures need Chromium, which is not installed (Debian: apt-get install chromium)")
    script = RECORD.replace("WIDTH", str(SIZE[0])).replace("HEIGHT", str(SIZE[1]))
    script = script.replace("FILM", str(film)).replace("FRAMES", str(frames))
    with tempfile.TemporaryDirectory() as folder:
        asked = Path(folder) / "motion.html"
        asked.write_text(POLICY.sub("", text).replace("</body>", f"{script}</body>"), encoding="utf-8")
        call = [browser, *FLAGS, asked.as_uri()]
        try:
            done = subprocess.run(call, capture_output=True, text=True, timeout=TIMEOUT, check=False)
        except subprocess.TimeoutExpired as error:
            raise ReportError(f"the browser has drawn no motion within {TIMEOUT:g} s") from error
    found = re.search(r'<pre id="taken">(.*?)</pre>', done.stdout, re.DOTALL)
    if found is None:
        raise ReportError(f"the browser has drawn no motion: {done.stderr.strip()[-300:]}")
    taken = json.loads(html.unescape(found.group(1)))
    return [base64.b64decode(each.partition(",")[2]) for each in taken]


def joined(pictures: Sequence[bytes], kind: str) -> bytes:
    """Return a moving picture of some pictures: the best of ``WAYS`` that is not too large, or the last of them."""
    from PIL import Image

    frames: list[Any] = []
    for each in pictures:
        whole = Image.new("RGB", SIZE, "white")
        drawing = Image.open(io.BytesIO(each)).convert("RGBA").resize(SIZE)
        whole.paste(drawing, mask=drawing)
        frames.append(whole)
    content = b""
    for quality, every, share in WAYS:
        size = round(share * SIZE[0]), round(share * SIZE[1])
        first, *others = [frame.resize(size) for frame in frames[::every]]
        found, options = io.BytesIO(), {"quality": quality, "method": 4} if kind == "WEBP" else {}
        lasting = round(1000 * every / RATE)
        first.save(found, kind, save_all=True, append_images=others, duration=lasting, loop=0, **options)
        content = found.getvalue()
        if len(content) <= MOST_BYTES:
            break
    return content
