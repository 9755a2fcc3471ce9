"""Run the Python blocks of a page in order, in one namespace; after each, a line with END marks what it printed.

Read from standard input: a JSON list of [place, line, text]. A fault is raised with the page and its line.
"""

from __future__ import annotations

import json
import sys
import warnings

END = "\x1e"


def main() -> None:
    """Run what standard input has; deprecated names of symphys are errors."""
    warnings.filterwarnings("error", message="symphys", category=DeprecationWarning)
    namespace: dict[str, object] = {"__name__": "__main__"}
    for page, line, text in json.load(sys.stdin):
        exec(compile("\n" * (line - 1) + text, page, "exec"), namespace)
        sys.stdout.flush()
        print(END, flush=True)


if __name__ == "__main__":
    main()
