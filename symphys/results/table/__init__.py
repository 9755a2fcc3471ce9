"""The table of all runs below a folder: read from the run folders, and cached beside them.

The run folders are the only truth. ``Journal(out).add(folder)`` keeps the row of a run that has ended;
``read_rows(out)`` takes a kept row only where it was made from the result.json that is there now, and reads the folder
otherwise; ``write_table(out)`` writes all rows as runs.csv and runs.parquet.
"""

from symphys.results.table.choosing import best, chosen, ordered
from symphys.results.table.columns import columns
from symphys.results.table.journal import Journal
from symphys.results.table.rows import Rows, read_rows
from symphys.results.table.writing import write_table

__all__ = ["Journal", "Rows", "best", "chosen", "columns", "ordered", "read_rows", "write_table"]
