"""Reports made from run folders alone: a page for a run, one for a batch, one for a motion.

Every page is one HTML file that needs nothing else: no network, no other file. Importing this package imports
matplotlib; import it where a report is written, not before.
"""

from symphys.report.pages.batch import write_batch_report
from symphys.report.pages.motion import write_motion
from symphys.report.pages.run import write_run_report

__all__ = ["write_batch_report", "write_motion", "write_run_report"]
