"""Run the Python blocks of a page in order, in one namespace; after each, a line with END marks the end of its output.

Read from standard input: a JSON list [place, line, text] on each line. A fault is raised with the page and its line.
"""

from __future__ import annotations

import json
import sys
import warnings

END = "\x1e"


def main() -> None:
    """Run each block as soon as it is read; deprecated names of symphys are errors."""
    warnings.filterwarnings("error", message="symphys", category=DeprecationWarning)
    namespace: dict[str, object] = {"__name__": "__main__"}
    while block := sys.stdin.readline():
        page, line, text = json.loads(block)
        exec(compile("\n" * (line - 1) + text, page, "exec"), namespace)
        sys.stdout.flush()
        print(END, flush=True)


if __name__ == "__main__":
    main()
