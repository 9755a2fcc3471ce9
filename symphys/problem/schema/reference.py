"""The JSON schema of problem files, and the reference page of all their keys."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from math import isinf
from types import MappingProxyType
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from symphys.problem.reading.messages import listed
from symphys.problem.reading.solver_options import options_model
from symphys.problem.schema import Document
from symphys.problem.schema.physics import MemberTable, SurfaceTable
from symphys.problem.schema.types import numbers_schema

DIALECT = "https://json-schema.org/draft/2020-12/schema"
UNIT = re.compile(r" ?\[((?:m|s|kg|rad|Hz|N|degrees|1/s)(?:[ /^][\w /^]*)?)\]")
"""A unit in a description: [m], [N m s/rad]."""
DEFAULT = re.compile(r"(?:^|[;:.,] )[Dd]efault:? ([^.;]+)(?=[.;]|$)")
"""A default in words, in the description of an optional key."""
COMPONENTS = {2: "[a, b]", 3: "[x, y, z]", 4: "[w, x, y, z]"}
HEAD = """# Reference of problem files

This page lists every table and key. [Problem files](problem_files.md) explains them by examples. `symphys schema`
prints a JSON Schema, with which editors complete and check problem files.

A `[table]` occurs once, a `[[table]]` any number of times; a heading with a dot is a table inside another. Units are
SI, z points up, and coordinates are world coordinates unless stated otherwise. A key marked *needed* is required.

- *name*: letters, digits and `_`, starting with a letter.
- *text*: any string. *formula*: a text in the language of [formulas](formulas.md).
- *numbers*: one number for all components, a list with one for each, or a list of such lists, one for each knot.
"""
SHARED = "These keys belong to `[[body]]`, `[ground]`, `[[plane]]`, `[[block]]` and `[[terrain]]`."
REPEATED = {
    "body.shape.parts": ("body.shape", "[[body]]"),
    "[[block]]": ("[[body]]",),
    "block.shape": ("body.shape.parts",),
    "joint.slider": ("joint.hinge",),
    "joint.helical": ("joint.hinge",),
    "[[site]]": ("[[body]]",),
    "[[constraint]]": ("[[target]]",),
    "[[output]]": ("[[target]]",),
    "recording.frame": ("[[body]]",),
    "recording.inputs": ("recording.measured",),
    "[solver.cma]": ("[solver.stochastic]",),
    "[solver.evolution]": ("[solver.stochastic]",),
}
"""Headings of tables to those of others whose rows they repeat: equal rows become one row that links there."""
EVERY_SOLVER = "Options of every solver"
Schema = Mapping[str, Any]


def json_schema(solvers: Mapping[str, type[Any]] | None = None) -> dict[str, Any]:
    """The schema of a whole file.

    Args:
        solvers: solver names to the dataclasses of their options, to be checked too; other names become errors.
    """
    models = {name: options_model(cls) for name, cls in (solvers or {}).items()}
    known: list[type[BaseModel]] = [Document, *models.values()]
    references, definitions = models_json_schema([(model, "validation") for model in known])
    shared: dict[str, Any] = definitions["$defs"]
    document = shared.pop("Document")
    if models:
        document["properties"]["solver"] = {
            "type": "object",
            "description": "options by solver",
            "properties": {name: references[model, "validation"] for name, model in models.items()},
            "additionalProperties": False,
        }
    result: dict[str, Any] = plain({"$schema": DIALECT, **document, "$defs": shared})
    result["title"] = "symphys problem"
    return result


def plain(node: Any) -> Any:
    """The schema without null, which TOML does not have, and without infinite defaults, which JSON cannot write."""
    if isinstance(node, list):
        return [plain(item) for item in node]
    if not isinstance(node, dict):
        return node
    kept = {key: plain(value) for key, value in node.items() if value is not None and not infinite(value)}
    choices = kept.get("anyOf")
    if not isinstance(choices, list) or {"type": "null"} not in choices:
        return kept
    remaining = [choice for choice in choices if choice != {"type": "null"}]
    del kept["anyOf"]
    return {**remaining[0], **kept} if len(remaining) == 1 else {"anyOf": remaining, **kept}


def infinite(value: Any) -> bool:
    """Whether a value is an infinite number."""
    return isinstance(value, float) and isinf(value)


SURFACE = plain(MemberTable.model_json_schema())
"""The keys that bodies and static surfaces share, some of them with pairs."""


def reference_page(solvers: Mapping[str, type[Any]]) -> str:
    """The whole page.

    Args:
        solvers: solver names to the dataclasses of their options, in the order of the page.
    """
    schema = json_schema(solvers)
    tables = {name: key for name, key in schema["properties"].items() if name not in ("solver", "set")}
    options = {f"solver.{name}": key for name, key in schema["properties"]["solver"]["properties"].items()}
    titles = headings({**tables, **options}, schema)
    old = {definition_of(key): name for name, key in tables.items() if key.get("deprecated")}
    parts = [HEAD, section("Top of the file", "Keys before the first table.")]
    parts.append(table({"properties": {k: v for k, v in tables.items() if not definition_of(v)}}, titles))
    by_title = {title: schema["$defs"][name]["properties"] for name, title in titles.items()}
    limits = shared_by([by_title[f"[{path}]"] for path in options])
    for name, title in titles.items():
        definition = schema["$defs"][name]
        elsewhere = {other: by_title[other] for other in REPEATED.get(title, ()) if other in by_title}
        solver = title.removeprefix("[solver.").removesuffix("]")
        if solver in solvers:
            unlimited = {field.name for field in fields(solvers[solver]) if infinite(field.default)}
            if solver == next(iter(solvers)):
                parts += [
                    section(EVERY_SOLVER, "They belong to each of the following tables."),
                    table(limits, titles, unlimited),
                ]
            own = {k: v for k, v in definition["properties"].items() if k not in limits["properties"]}
            parts.append(section(f"`{title}`", f"[Solvers](solvers.md#{solver}) explains it."))
            parts.append(table({"properties": own}, titles, unlimited, elsewhere))
            continue
        if title == "[[body]]":
            shared = f"{text_of(SurfaceTable.model_json_schema())} {SHARED}"
            parts += [section("Surfaces", shared), table(SURFACE, titles)]
        renamed = f" The old name `[{old[name]}]` is still read." if name in old else ""
        elsewhere = {"Surfaces": SURFACE["properties"], **elsewhere}
        parts += [section(f"`{title}`", text_of(definition) + renamed), table(definition, titles, (), elsewhere)]
    parts.append(section("`[set]`", sentence(schema["properties"]["set"]["description"])))
    return "\n".join(parts)


def headings(tables: Mapping[str, Schema], schema: Schema) -> dict[str, str]:
    """Definitions to the headings of their sections: ``[[body]]``, ``body.shape``; in the order of their first use."""
    titles: dict[str, str] = {}

    def visit(path: str, key: Schema) -> None:
        name = definition_of(key)
        if name is None or name in titles or not schema["$defs"][name].get("properties"):
            return
        many, top = key.get("type") == "array", path in tables
        titles[name] = (f"[[{path}]]" if many else f"[{path}]") if top else path
        for inner, value in schema["$defs"][name]["properties"].items():
            visit(f"{path}.{inner}", value)

    for path, key in tables.items():
        visit(path, key)
    return titles


def definition_of(key: Schema) -> str | None:
    """The name of the definition that a value refers to, or each item of a list, or each value of a table."""
    by_name = key.get("additionalProperties") or {}
    by_name = by_name if isinstance(by_name, dict) else {}
    choices = [key, key.get("items", {}), *key.get("oneOf", []), *by_name.get("oneOf", [])]
    found = next((choice["$ref"] for choice in choices if "$ref" in choice), None)
    return None if found is None else str(found).removeprefix("#/$defs/")


def section(title: str, text: str) -> str:
    """A heading and what is said below it; tables within others have a heading of the third level."""
    return f"{'###' if '.' in title and '[' not in title else '##'} {title}\n\n{text}\n"


def shared_by(tables: Sequence[Schema]) -> Schema:
    """Return a table of the keys that all of some tables have, with one meaning."""
    first, *others = tables
    return {"properties": {name: key for name, key in first.items() if all(key == each.get(name) for each in others)}}


def table(
    definition: Schema,
    titles: Mapping[str, str],
    unlimited: Collection[str] = (),
    elsewhere: Mapping[str, Schema] = MappingProxyType({}),
) -> str:
    """Return the keys of a table, those first that are needed.

    Args:
        definition: the table's JSON Schema.
        titles: headings of the sections by definition.
        unlimited: keys whose default is inf, which JSON cannot write.
        elsewhere: by the heading of another section the keys that it lists; equal ones share a row that links there.
    """
    needed = definition.get("required", [])
    keys = sorted(definition["properties"].items(), key=lambda item: item[0] not in needed)
    listed_in: dict[str, str] = {}
    for title, others in elsewhere.items():
        for name, key in keys:
            if key == others.get(name):
                listed_in.setdefault(name, title)
    rows = ["| key | type | default | meaning |", "|---|---|---|---|"]
    for name, key in keys:
        if name not in listed_in:
            rows.append(row(name, key, titles, "needed" if name in needed else "`inf`" if name in unlimited else ""))
    for title in elsewhere:
        names = [f"`{name}`" for name, _ in keys if listed_in.get(name) == title]
        link = f"[{title.strip('[]')}](#{anchor(title)})"
        if len(names) == len(elsewhere[title]):
            rows.append(f"| all of {link} | | | |")
        elif names:
            rows.append(f"| {', '.join(names)} | | | see {link} |")
    return "\n".join(rows) + "\n"


def row(name: str, key: Schema, titles: Mapping[str, str], fallback: str) -> str:
    """One key: its type with its unit, its default, and what is left of its description."""
    meaning = str(key.get("description", ""))
    units = UNIT.findall(meaning)
    kind = type_of(key, titles)
    if len(units) == 1:
        kind, meaning = f"{kind} [{units[0]}]", UNIT.sub("", meaning).lstrip(",: ")
    stated = DEFAULT.search(meaning)
    standard = fallback or default_of(key)
    if stated and not fallback:
        standard, meaning = stated[1], DEFAULT.sub("", meaning, count=1).strip()
    meaning = meaning or text_of_table(key, titles)
    return "| " + " | ".join(cell(each) for each in (f"`{name}`", kind, standard, sentence(meaning))) + " |"


def text_of_table(key: Schema, titles: Mapping[str, str]) -> str:
    """Return the meaning of a key without a description, which its table gives."""
    name = definition_of(key)
    return f"see `{titles[name]}`" if name is not None and name in titles else ""


def cell(text: str) -> str:
    """A text that does not end a cell of a table."""
    return text.replace("|", "\\|").replace("``", "`")


def sentence(text: str) -> str:
    """A description as a sentence, where it begins with a word."""
    text = with_code(" ".join(text.split()))
    first = re.match(r"(?![xyz]\b)[a-z]+\b(?![_.(\[=])", text)
    text = text[:1].upper() + text[1:] if first else text
    text = f"For instance {text}" if re.fullmatch(r"`[^`]*`", text) else text
    return text if not text or text.endswith((".", "?", ":")) else f"{text}."


def with_code(text: str) -> str:
    """A text with its tables, ``{ radius = 0.5 }`` and ``[[pair]]``, set as code."""
    text = re.sub(r"(?<!`)(\[\[?[a-z_]{4,}\]\]?)(?![\w`])", r"`\1`", text.replace("``", "`"))
    found, depth = "", 0
    for k, letter in enumerate(text):
        if depth or letter == "{" or text[k : k + 2] == "[{":
            found += letter if depth else f"`{letter}"
            depth += (letter in "{[") - (letter in "}]")
            found += "" if depth else "`"
        else:
            found += letter
    return found


def text_of(definition: Schema) -> str:
    """Return the paragraphs of a table's docstring."""
    paragraphs = str(definition.get("description", "")).split("\n\n")
    return "\n\n".join(with_code(" ".join(part.split())) for part in paragraphs)


def default_of(key: Schema) -> str:
    """The default as a problem file would write it; nothing for what is empty or a table."""
    value = key.get("default")
    return "" if value in (None, "", [], {}) or isinstance(value, dict) else f"`{written(value)}`"


def written(value: Any) -> str:
    """A value of a problem file, numbers without needless digits."""
    if isinstance(value, list):
        return f"[{', '.join(written(item) for item in value)}]"
    return f"{value:g}" if isinstance(value, float) else json.dumps(value)


def type_of(key: Schema, titles: Mapping[str, str]) -> str:
    """The kind of value in a few words: ``number > 0``, ``[x, y, z]``, ``"end" or number``."""
    if [*key.get("anyOf", ())] == numbers_schema()["anyOf"]:
        return "numbers"
    choices = key.get("anyOf") or key.get("oneOf")
    if choices:
        flat = [{"const": value} for choice in choices for value in choice.get("enum", [])]
        flat += [choice for choice in choices if "enum" not in choice]
        kinds = list(dict.fromkeys(type_of(choice, titles) for choice in flat))
        return kinds[0] if len(kinds) == 1 else listed(kinds, "or")
    if "$ref" in key:
        name = definition_of(key)
        return f"[table](#{anchor(titles[name])})" if name is not None and name in titles else "`{ }`"
    if "enum" in key or "const" in key:
        values = [f'`"{value}"`' for value in key.get("enum", [key.get("const")])]
        return values[0] if len(values) == 1 else listed(values, "or")
    if key.get("type") == "array":
        return list_type(key, titles)
    if key.get("type") == "string":
        if "examples" in key:
            return f'`"{key["examples"][0]}"`'
        return "name" if "pattern" in key else "text"
    if key.get("type") == "object":
        name = definition_of(key)
        return f"[table](#{anchor(titles[name])})" if name is not None and name in titles else "table"
    if key.get("type") == "boolean":
        return "boolean"
    return number_type(key)


def list_type(key: Schema, titles: Mapping[str, str]) -> str:
    """The kind of a list, with as many items as it must have."""
    items = key.get("items") or key["prefixItems"][0]
    count = key.get("minItems") if key.get("minItems") == key.get("maxItems") else None
    if count in COMPONENTS and items.get("type") in ("number", "string"):
        return f"`{COMPONENTS[count]}`" if items["type"] == "number" else "`[" + ", ".join(['"..."'] * count) + "]`"
    return f"list of {'' if count is None else f'{count} '}{several(type_of(items, titles))}"


def several(kind: str) -> str:
    """The plural of a kind."""
    return re.sub(r"^(\[?)(number|integer|text|name|table|list)\b", r"\1\2s", kind)


def number_type(key: Schema) -> str:
    """A number and its range."""
    kind = "integer" if key.get("type") == "integer" else "number"
    low, high = key.get("minimum"), key.get("maximum")
    if low is not None and high is not None:
        return f"{kind}, {low:,} to {high:,}"
    above, below = key.get("exclusiveMinimum"), key.get("exclusiveMaximum")
    signs = {">": above, ">=": low, "<": below, "<=": high}
    bounds = [f" {sign} {end:g}" for sign, end in signs.items() if end is not None]
    return kind + " and".join(bounds)


def anchor(title: str) -> str:
    """The anchor of a heading, as code hosts and the site make it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
