"""One module for each pair of shapes; each returns contacts of one kind."""
