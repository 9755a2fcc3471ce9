"""The bundle that draws motions in three dimensions is that of its sources, and has its licence beside it."""

from __future__ import annotations

import hashlib
import json
import re

from symphys.report.pages.markup import HERE

SOURCES = HERE.parent / "viewer"


def test_the_bundle_is_that_of_its_sources() -> None:
    """`make viewer` writes a checksum of what it bundles into the first line."""
    whole = b"".join((SOURCES / name).read_bytes() for name in ("stage.js", "package-lock.json"))
    first = (HERE / "viewer.js").read_text("utf-8").partition("\n")[0]
    version, digest = re.findall(r"three ([\d.]+), MIT, and stage.js (\w+)", first)[0]
    assert digest == hashlib.sha256(whole).hexdigest()[:16], "stage.js has changed: make viewer"
    assert json.loads((SOURCES / "package.json").read_text())["dependencies"] == {"three": version}


def test_its_licence_is_beside_it() -> None:
    assert "The MIT License" in (HERE / "three.LICENSE").read_text("utf-8")
