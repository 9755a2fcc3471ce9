"""The command line: ``symphys``."""

from symphys.cli.app import main

__all__ = ["main"]
