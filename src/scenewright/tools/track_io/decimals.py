"""Numbers of a table, with a decimal point or, as in much of Europe, a decimal comma."""

from __future__ import annotations

import re

_WITH_COMMA = re.compile(r"[+-]?\d+,\d+(e[+-]?\d+)?", re.IGNORECASE)
SEPARATE = "numbers with a decimal comma need another separator, such as a semicolon"


class DecimalReader:
    """Reads the numbers of one file, which has one decimal sign.

    In a file with both, 1,234 might be a thousand as well.
    """

    def __init__(self) -> None:
        self._sign = ""

    def parse(self, cell: str) -> float:
        """The number in a cell.

        Raises:
            ValueError: there is none; says why, to go on after the cell.
        """
        sign = "," if _WITH_COMMA.fullmatch(cell) else "." if "." in cell else ""
        try:
            if "_" in cell:
                raise ValueError
            value = float(cell.replace(",", ".") if sign == "," else cell)
        except ValueError:
            raise ValueError("not a number") from None
        if sign and self._sign and sign != self._sign:
            raise ValueError(f"although others have a decimal {self._sign!r}; keep one sign")
        self._sign = sign or self._sign
        return value
