"""Names of older versions: each works, warns, and is in the table of docs/python.md."""

from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from tools.repeats import few

import symphys
from symphys.deprecated import CALLS, NAMES

PAGE = Path(__file__).parents[2] / "docs" / "python.md"


def found(path: str) -> object:
    """What a dotted name leads to."""
    module, _, name = path.rpartition(".")
    return getattr(import_module(module), name)


@pytest.mark.parametrize("name", NAMES)
def test_a_deprecated_name_is_what_it_was(name: str) -> None:
    home, replacement = NAMES[name]
    with pytest.warns(
        DeprecationWarning, match=re.escape(f"symphys.{name} is deprecated; use {replacement}")
    ) as caught:
        public = getattr(symphys, name)
    assert public is found(f"{home}.{name}")
    assert [each.filename for each in caught] == [__file__]
    assert name not in symphys.__all__ and callable(found(replacement.split()[0]))


@pytest.mark.parametrize("name", CALLS)
def test_a_package_can_still_be_called(name: str, tmp_path: Path) -> None:
    """It does what its function does; here that is to refuse a folder where nothing is."""
    missing = str(tmp_path / "nothing")
    with pytest.raises(symphys.SymphysError) as wanted:
        found(CALLS[name])(missing)  # type: ignore[operator]
    with (
        pytest.warns(DeprecationWarning, match=re.escape(f"symphys.{name}(...) is deprecated; use {CALLS[name]}")),
        pytest.raises(symphys.SymphysError) as error,
    ):
        getattr(symphys, name)(missing)
    assert str(error.value) == str(wanted.value)


@few("statement", ["import symphys", "import symphys.report", "from symphys.report import outdated"], 1)
def test_a_package_can_be_called_however_it_is_imported(statement: str) -> None:
    code = f"import symphys\n{statement}\ntry: symphys.report('nothing')\nexcept symphys.SymphysError: print('called')"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, check=True, timeout=300
    )
    assert done.stdout == "called\n"


def test_the_page_lists_them() -> None:
    table = PAGE.read_text(encoding="utf-8").partition("## Deprecated names")[2]
    listed = set(
        re.findall(r"`(\w+)[`(]", "".join(line.split("|")[1] for line in table.splitlines() if line.startswith("| `")))
    )
    assert listed == {*NAMES, *CALLS}
