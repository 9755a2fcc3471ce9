"""One module for each kind of table of a problem file: from validated values to the problem's parts."""
