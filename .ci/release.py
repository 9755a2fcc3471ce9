"""Build the wheel and the source distribution, and check what a user would get from them; publish nothing.

    python .ci/release.py [--out dist] [--python PATH ...]

1. The version is the same in symphys/version.py, CITATION.cff and the newest heading of CHANGELOG.md.
2. ``python -m build`` makes both archives.
3. The description renders as a package index renders it, with no link that would be broken there.
4. Each archive is installed into a fresh environment of each Python that the classifiers of setup.cfg name and that
   this machine has. There ``symphys --version``, ``symphys doctor`` and ``symphys solve ball_throw`` run in an empty
   folder with an empty cache.

It needs the packages build and readme_renderer[md], and a package index for what symphys depends on.
"""

from __future__ import annotations

import argparse
import email
import os
import re
import shutil
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator, Sequence
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
COMMANDS = (["--version"], ["doctor"], ["solve", "ball_throw"])
"""Arguments of symphys that run in each fresh environment."""
LEADS = re.compile(r'(?:href|src)="(?!https?://|#|mailto:)([^"]*)"')
"""Targets in rendered HTML that an index does not have."""


def main(arguments: Sequence[str]) -> int:
    """Run all checks, print what was done, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="where the archives go")
    parser.add_argument("--python", action="append", help="an interpreter to try; default: those of setup.cfg")
    given = parser.parse_args(arguments)
    faults = version_faults()
    archives = built(given.out.resolve())
    faults += description_faults(next(path for path in archives if path.suffix == ".whl"))
    for name, path in [(each, each) for each in given.python or ()] or [(f"python{v}", python(v)) for v in versions()]:
        if path is None:
            print(f"missing  {name}: not on this machine, not tried", flush=True)
            continue
        for archive in archives:
            fault = tried(path, archive)
            print(f"{'failed' if fault else 'ok':8} {name}: {archive.name}", flush=True)
            faults += [f"{name}, {archive.name}: {fault}"] if fault else []
    print("\n".join(f"FAULT: {fault}" for fault in faults) or f"version {version()} can be released", flush=True)
    return 1 if faults else 0


def version() -> str:
    """Return the version of the package, without importing it."""
    return found(r'^__version__ = "(.+)"', "symphys/version.py")


def found(pattern: str, name: str) -> str:
    """Return what the group of a pattern matches first in a file; "" if nothing does."""
    match = re.search(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)
    return match[1] if match else ""


def version_faults() -> list[str]:
    """Return what disagrees with the version of the package."""
    said = {
        "the newest heading of CHANGELOG.md": found(r"^## \[?([\w.]+)", "CHANGELOG.md"),
        "CITATION.cff": found(r"^version: *(\S+)", "CITATION.cff"),
    }
    wrong = {where: what for where, what in said.items() if what != version()}
    return [f"{where} has {what or 'none'}, the package {version()}" for where, what in wrong.items()]


def built(out: Path) -> list[Path]:
    """Build both archives into a folder, and return them: the wheel, then the source distribution."""
    began = time.perf_counter()
    command = [sys.executable, "-m", "build", "--outdir", str(out), str(ROOT)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    archives = [out / f"symphys-{version()}-py3-none-any.whl", out / f"symphys-{version()}.tar.gz"]
    for path in archives:
        print(f"built    {path.name}: {path.stat().st_size / 2**20:.1f} MiB", flush=True)
    print(f"         in {time.perf_counter() - began:.0f} s", flush=True)
    return archives


def description_faults(wheel: Path) -> list[str]:
    """Return what an index would say of the description, and links that lead nowhere there."""
    from readme_renderer import markdown

    with zipfile.ZipFile(wheel) as archive:
        name = next(each for each in archive.namelist() if each.endswith(".dist-info/METADATA"))
        text = email.message_from_bytes(archive.read(name)).get_payload()
    warnings = StringIO()
    page = markdown.render(text, stream=warnings)
    if page is None:
        return [f"the description does not render: {warnings.getvalue().strip()}"]
    broken = LEADS.findall(page)
    print(f"rendered the description: {len(page)} characters of HTML, {page.count('<img')} pictures", flush=True)
    return [f"the description has links that an index does not have: {', '.join(broken)}"] if broken else []


def versions() -> list[str]:
    """Return the versions of Python that setup.cfg names, oldest first."""
    text = (ROOT / "setup.cfg").read_text(encoding="utf-8")
    return re.findall(r"Programming Language :: Python :: (3\.\d+)", text)


def python(version: str) -> str | None:
    """Return an interpreter of a version that runs; None if there is none."""
    return next((path for path in candidates(version) if runs(path)), None)


def candidates(version: str) -> Iterator[str]:
    """Yield interpreters on PATH, then those of pyenv."""
    yield from (path for folder in os.get_exec_path() if (path := shutil.which(f"python{version}", path=folder)))
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    yield from map(str, sorted(pyenv.glob(f"{version}.*/bin/python{version}"), reverse=True))


def runs(path: str) -> bool:
    """Whether an interpreter starts and can make an environment; shims of a version that is not chosen do not."""
    return subprocess.run([path, "-c", "import ensurepip, venv"], capture_output=True, check=False).returncode == 0


def tried(interpreter: str, archive: Path) -> str:
    """Install an archive into a fresh environment and run the commands there; return what failed, or ""."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        scripts = folder / "venv" / ("Scripts" if os.name == "nt" else "bin")
        work = folder / "work"
        work.mkdir()
        environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "VIRTUAL_ENV")}
        environment |= {"SYMPHYS_CACHE": str(folder / "cache")}
        calls = [
            [interpreter, "-m", "venv", str(folder / "venv")],
            [str(scripts / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(archive)],
            *([str(scripts / "symphys"), *command] for command in COMMANDS),
        ]
        for call in calls:
            done = subprocess.run(call, cwd=work, env=environment, capture_output=True, text=True, check=False)
            if done.returncode:
                said = (done.stderr or done.stdout).strip()[-400:]
                return f"{Path(call[0]).name} {' '.join(call[1:])}: exit {done.returncode}: {said}"
            if call[-1] == "--version" and version() not in done.stdout:
                return f"symphys --version says {done.stdout.strip()}"
    return ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
