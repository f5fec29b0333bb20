"""Rows of text from columns of numbers: a million of them in about half a second."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

FEW = 2000
"""Up to so many rows, importing numpy would take longer than writing them."""

CHUNK = 1 << 14
"""Rows written at a time: what they need fits into the processor's cache."""

LARGEST = 2.0**52
"""Scaled values below it keep the half by which they are rounded."""

_MARK = re.compile(r"%d|%\.(\d)f|%\.(1\d)f|%s")


Sheet: TypeAlias = "tuple[str, Sequence[Sequence[Any]]]"
"""A template, and the columns that it takes."""


def rows(template: str, *columns: Sequence[Any]) -> bytes:
    r"""A row for each place in some columns, all by the same template.

    Parameters
    ----------
    template
        As of the operator ``%``, with ``%d``, ``%.Nf`` and ``%s`` (ASCII) for the columns in
        their order; no number is written as a negative zero.
    columns
        N numbers or texts each.

    Returns
    -------
    text
        N rows, UTF-8; each number is the decimal nearest to its float, ties to even, whatever N.

    Examples
    --------
    >>> rows("%d: %.2f\n", range(3), [0.125, -0.001, 99.995])
    b'0: 0.12\n1: 0.00\n2: 100.00\n'
    """
    return b"".join(text for (text,) in blocks((template, columns)))


def blocks(*wanted: Sheet) -> Iterator[list[bytes | bytearray]]:
    """`rows` by several templates at once, some thousand of each at a time.

    Columns that templates share are written once; all have the same length.
    """
    count = len(wanted[0][1][0]) if wanted[0][1] else 0
    if count <= FEW:
        yield [_by_row(template, columns) for template, columns in wanted]
        return
    for start in range(0, count, CHUNK):
        # A column given twice stays one column.
        parts = {
            id(column): column[start : start + CHUNK] for _, columns in wanted for column in columns
        }
        known = Fields()
        yield [
            by_column(template, [parts[id(column)] for column in columns], known)
            for template, columns in wanted
        ]


def _decimals(template: str) -> list[int | None]:
    """Decimals of each mark; None for text."""
    return [
        None if mark[0] == "%s" else int(mark[1] or mark[2] or 0)
        for mark in _MARK.finditer(template)
    ]


def _by_row(template: str, columns: Sequence[Sequence[Any]]) -> bytes:
    # Rounding first, and adding zero, turns what would be written "-0.0" into a plain zero.
    plain = [
        [round(value, decimals) + 0.0 for value in column] if decimals else column
        for column, decimals in zip(columns, _decimals(template), strict=True)
    ]
    return "".join(map(template.__mod__, zip(*plain, strict=True))).encode()


class Fields:
    """Columns as tables of bytes, each made once."""

    def __init__(self) -> None:
        self._arrays: dict[int, NDArray[Any]] = {}
        self._fields: dict[tuple[int, int | None], NDArray[Any] | None] = {}

    def of(self, column: Sequence[Any], decimals: int | None) -> NDArray[Any] | None:
        """A column's bytes, zero where a value is shorter than others; None: it is too large."""
        import numpy as np

        key = (id(column), decimals)
        if key not in self._fields:
            if key[0] not in self._arrays:
                self._arrays[key[0]] = np.asarray(column)
            array = self._arrays[key[0]]
            self._fields[key] = _words(array) if decimals is None else _digits(array, decimals)
        return self._fields[key]


def by_column(template: str, columns: Sequence[Sequence[Any]], known: Fields) -> bytes | bytearray:
    """Rows as a table of bytes, in which zero bytes fill what a shorter value leaves free."""
    import numpy as np

    fields = [
        known.of(column, decimals)
        for column, decimals in zip(columns, _decimals(template), strict=True)
    ]
    row, places = bytearray(), []
    for text, field in zip(
        _MARK.split(template.replace("%%", "%"))[:: 1 + _MARK.groups], [*fields, None], strict=True
    ):
        row += text.encode()
        if field is not None:
            places.append((len(row), field))
            row += bytes(field.shape[1])
    if len(places) < len(fields):
        return _by_row(template, columns)
    content = row * len(columns[0])
    table = np.frombuffer(content, np.uint8).reshape(-1, len(row))
    for place, field in places:
        table[:, place : place + field.shape[1]] = field
    if all(field.all() for _, field in places):
        return content
    return content.translate(None, b"\0")


def _words(values: NDArray[Any]) -> NDArray[Any]:
    import numpy as np

    return values.astype("S").view(np.uint8).reshape(len(values), -1)


def _digits(values: NDArray[Any], decimals: int) -> NDArray[Any] | None:
    """Each value as decimal digits, one byte a digit, zero bytes before them."""
    import numpy as np

    if max(values.max(), -values.min()) * 10.0**decimals >= LARGEST:
        return None
    scaled = _scaled(values, decimals)
    size = np.abs(scaled)
    least, most = int(size.min()), int(size.max())
    places = max(len(str(most)), decimals + 1)
    groups = -(-places // 4)
    # Four digits at a time, from a table of all ten thousand.
    table = np.arange(10_000)[:, None] // [1000, 100, 10, 1] % 10 + ord("0")
    quads = np.ascontiguousarray(table, np.uint8).view(np.uint32).ravel()
    words = np.empty((len(size), groups), np.uint32)
    rest = size
    for group in reversed(range(groups)):
        above = rest // 10_000
        words[:, group] = quads[rest - 10_000 * above]
        rest = above
    digits = words.view(np.uint8)[:, 4 * groups - places :]
    whole = places - decimals
    for place in range(whole - 1):
        smallest = 10 ** (places - 1 - place)
        if least < smallest:
            digits[size < smallest, place] = 0
    sign = int(scaled.min() < 0)
    field = np.empty((len(size), sign + places + (decimals > 0)), np.uint8)
    if sign:
        field[:, 0] = np.where(scaled < 0, ord("-"), 0)
    field[:, sign : sign + whole] = digits[:, :whole]
    if decimals:
        field[:, sign + whole] = ord(".")
        field[:, sign + whole + 1 :] = digits[:, whole:]
    return field


def _scaled(values: NDArray[Any], decimals: int) -> NDArray[Any]:
    """The integers nearest to values x 10^decimals, exactly: ties to even.

    The product's rounding error e is found as Dekker found it (Numer. Math. 18, 1971); it
    decides only where the rounded product lies halfway between two integers.
    """
    import numpy as np

    if values.dtype.kind in "iub":
        exact: NDArray[Any] = values.astype(np.int64) * 10**decimals
        return exact
    ten = 10.0**decimals
    product = values * ten
    nearest = np.rint(product)
    error = _product_error(values, ten, product)
    half = product - nearest
    nearest += (half == 0.5) & (error > 0.0)
    nearest -= (half == -0.5) & (error < 0.0)
    whole: NDArray[Any] = nearest.astype(np.int64)
    return whole


def _product_error(left: NDArray[Any], right: float, product: NDArray[Any]) -> NDArray[Any]:
    def split(value: Any) -> tuple[Any, Any]:
        upper = 134217729.0 * value
        upper = upper - (upper - value)
        return upper, value - upper

    (left_up, left_low), (right_up, right_low) = split(left), split(right)
    error: NDArray[Any] = (
        ((left_up * right_up - product) + left_up * right_low) + left_low * right_up
    ) + left_low * right_low
    return error
