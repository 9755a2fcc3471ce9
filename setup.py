"""Write the description that a package index shows; everything else about the package is in setup.cfg.

An index renders README.md without the files beside it. Where ``repository`` of setup.cfg names the address of the
sources, relative links and pictures lead there, at the tag of this version. Without an address, links become plain text
and pictures are left out, so that nothing is broken.
"""

from __future__ import annotations

import re
from configparser import ConfigParser
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).resolve().parent
LINK = re.compile(r"(?P<picture>!?)\[(?P<text>[^\]]*)\]\((?P<target>(?!\w+:|#)[^)\s]+)\)")
"""A Markdown link or picture with a relative target."""


def version() -> str:
    """Return the version, without importing the package."""
    text = (ROOT / "symphys" / "version.py").read_text(encoding="utf-8")
    return re.search(r'__version__ = "(.+)"', text)[1]


def repository() -> str:
    """Return the address of the sources; "" where setup.cfg names none."""
    parser = ConfigParser()
    parser.read(ROOT / "setup.cfg", encoding="utf-8")
    return parser.get("symphys", "repository", fallback="").strip().rstrip("/")


def description(text: str, address: str, tag: str) -> str:
    """Return a page whose relative links are absolute at ``address``, or plain text without one."""

    def absolute(link: re.Match[str]) -> str:
        if not address:
            return "" if link["picture"] else link["text"]
        kind = "raw" if link["picture"] else "blob"
        return f"{link['picture']}[{link['text']}]({address}/{kind}/{tag}/{link['target']})"

    return LINK.sub(absolute, text)


def addresses(address: str, tag: str) -> dict[str, str]:
    """Return the links of the package's page."""
    if not address:
        return {}
    pages = {"Documentation": "docs/index.md", "Changelog": "CHANGELOG.md"}
    return {"Source": address, **{name: f"{address}/blob/{tag}/{page}" for name, page in pages.items()}}


if __name__ == "__main__":
    tag = f"v{version()}"
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    setup(
        long_description=description(readme, repository(), tag),
        long_description_content_type="text/markdown",
        project_urls=addresses(repository(), tag),
    )
