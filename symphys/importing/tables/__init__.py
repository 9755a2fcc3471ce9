"""A compiled model of MuJoCo as tables of a problem file, a module for each kind of table."""
