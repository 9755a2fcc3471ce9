"""Reports made from run folders alone: a page for a run, one for a batch, one for a motion.

Every page is one HTML file that shows all without anything else: no network, no other file. Beside it lies a folder
with its figures as SVG and CSV, to which it links. Importing this package imports matplotlib; import it where a report
is written, not before. ``symphys.report(folder)`` makes the pages of all runs below a folder.
"""

from symphys.report.pages.batch import write_batch_report
from symphys.report.pages.folder import report, write_pages
from symphys.report.pages.motion import write_motion, write_motion_page
from symphys.report.pages.run import write_run_figures, write_run_report
from symphys.verbs import make_callable

__all__ = [
    "report",
    "write_batch_report",
    "write_motion",
    "write_motion_page",
    "write_pages",
    "write_run_figures",
    "write_run_report",
]

make_callable(__name__, report)
