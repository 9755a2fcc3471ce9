"""The tables and keys of a problem file, as pydantic models."""

from __future__ import annotations

from symphys.problem.schema.document import Document
from symphys.problem.schema.types import SchemaTable

__all__ = ["Document", "SchemaTable"]
