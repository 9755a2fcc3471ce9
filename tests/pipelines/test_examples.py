"""The examples of docstrings run."""

from __future__ import annotations

import doctest
from importlib import import_module

import pytest

pytestmark = pytest.mark.slow


@pytest.mark.slow
@pytest.mark.parametrize(
    ("library", "names"),
    [("torch", ("rollout", "step")), ("jax", ("rollout", "step")), ("gymnasium", ("VectorEnv", "Env"))],
)
def test_examples_run(library: str, names: tuple[str, ...]) -> None:
    pytest.importorskip(library)
    module = import_module(f"symphys.{library.replace('gymnasium', 'env')}")
    for name in names:
        (example,) = [e for e in doctest.DocTestFinder().find(getattr(module, name), name, globs={}) if e.examples]
        assert doctest.DocTestRunner().run(example).failed == 0


@pytest.mark.parametrize("module", ["torch", "jax", "env"])
def test_a_missing_library_is_said(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """With what to install."""
    import sys

    library = {"env": "gymnasium"}.get(module, module)
    monkeypatch.setitem(sys.modules, library, None)
    monkeypatch.delitem(sys.modules, f"symphys.{module}", raising=False)
    with pytest.raises(ImportError, match=rf"pip install '\.\[{module}\]'"):
        import_module(f"symphys.{module}")
