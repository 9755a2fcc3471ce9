"""A compiled model of MuJoCo as the tables of a problem file."""

from symphys.importing.tables.assemble import tables_of

__all__ = ["tables_of"]
