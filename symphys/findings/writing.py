"""Numbers and lists as people write them."""

from __future__ import annotations

import math
from collections.abc import Sequence

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MINUS = "\N{MINUS SIGN}"
DASH = "\N{EN DASH}"
NOTHING = "≈ 0"
NEGLIGIBLE = 1e-6
"""Share of what a number is compared with below which it is next to nothing."""
THIN_SPACE = "\N{NARROW NO-BREAK SPACE}"


def show(value: float, digits: int = 3) -> str:
    """Return a number with ``digits`` significant digits, as people write it; a dash for nan."""
    if math.isnan(value):
        return DASH
    if math.isinf(value):
        return "∞" if value > 0 else MINUS + "∞"
    text = f"{value:.{digits - 1}e}"
    mantissa, exponent = float(text[: text.index("e")]), int(text[text.index("e") + 1 :])
    if value == 0 or -4 < exponent < 6:
        return plain(float(text), max(digits - 1 - exponent, 0) if value else 0)
    return sign(f"{mantissa:g}" if mantissa not in (1, -1) else f"{mantissa:.0f}") + f" × 10{power(exponent)}"  # noqa: RUF001


def beside(value: float, scale: float, digits: int = 3) -> str:
    """Return a number that matters beside ``scale``: what is next to nothing there is written as such."""
    return NOTHING if 0 < abs(value) < NEGLIGIBLE * scale else show(value, digits)


def with_unit(number: str, unit: str) -> str:
    """Return a written number and its unit, where it has one."""
    return f"{number} {unit}" if unit else number


def titled(name: str, unit: str) -> str:
    """Return the title of a number: its name and in brackets its unit, where it has one."""
    return f"{name} [{unit}]" if unit else name


def percent(share: float) -> str:
    """Return a share >= 0 in percent; a dash for nan."""
    if not math.isfinite(share):
        return show(share)
    return f"{show(100 * share, 2)} %" if share == 0 or share >= 1e-6 else "< 0.0001 %"


def plain(value: float, decimals: int) -> str:
    """Write a number without an exponent or trailing zeros; thousands are set apart from 10 000 on."""
    text = f"{value:.{decimals}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    if abs(value) >= 10_000:
        whole, point, rest = text.partition(".")
        text = f"{int(whole):,}".replace(",", THIN_SPACE) + point + rest
    return sign("0" if text == "-0" else text)


def sign(text: str) -> str:
    """Return a true minus sign."""
    return text.replace("-", MINUS)


def power(exponent: int) -> str:
    """Return an exponent in superscripts."""
    return str(exponent).translate(SUPERSCRIPTS)


def several(number: int, noun: str, plural: str = "") -> str:
    """Write ``1 run``, ``3 runs``."""
    return f"{number} {noun if number == 1 else plural or noun + 's'}"


def listed(parts: Sequence[str]) -> str:
    """Write ``a``, ``a and b``, ``a, b and c``."""
    return " and ".join([", ".join(parts[:-1]), parts[-1]]) if len(parts) > 1 else "".join(parts)


def capital(text: str) -> str:
    """Return the text with a capital letter."""
    return text[:1].upper() + text[1:]
