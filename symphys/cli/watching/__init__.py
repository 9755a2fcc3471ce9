"""What is shown while work goes on: live lines on a terminal, plain ones elsewhere, events for other programs.

A share done and a time left go with them: of a run from its budget, of a batch from the runs that are over, of other
work from the parts that it is known to have.
"""

from symphys.cli.watching.choice import watch
from symphys.cli.watching.heartbeat import working

__all__ = ["watch", "working"]
