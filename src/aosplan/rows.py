"""Rows of text from columns of numbers: a million of them in about half a second."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

FEW = 2000
"""Up to so many rows, importing numpy would take longer than writing them."""

CHUNK = 1 << 14
"""Rows written at a time: what they need fits into the processor's cache."""

LARGEST = 2.0**52
"""Scaled values below it keep the half by which they are rounded."""

_MARK = re.compile(r"%d|%\.(\d)f|%\.(1\d)f|%s")


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
    count = len(columns[0]) if columns else 0
    if count <= FEW:
        return _by_row(template, columns)
    buffer = io.BytesIO()
    for start in range(0, count, CHUNK):
        stop = start + CHUNK
        # A column given twice stays one column.
        parts = {id(column): column[start:stop] for column in columns}
        buffer.write(_by_column(template, [parts[id(column)] for column in columns]))
    return buffer.getvalue()


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


def _by_column(template: str, columns: Sequence[Sequence[Any]]) -> bytes | bytearray:
    """Rows as a table of bytes, in which zero bytes fill what a shorter value leaves free."""
    import numpy as np

    texts = _MARK.split(template.replace("%%", "%"))[:: 1 + _MARK.groups]
    arrays = {id(column): np.asarray(column) for column in columns}
    marks = [
        (id(column), decimals)
        for column, decimals in zip(columns, _decimals(template), strict=True)
    ]
    for name, decimals in marks:
        if decimals is not None and np.abs(arrays[name]).max() * 10.0**decimals >= LARGEST:
            return _by_row(template, columns)
    written = {mark: _field(arrays[mark[0]], mark[1]) for mark in set(marks)}
    fields = [written[mark] for mark in marks]
    parts: list[NDArray[Any]] = [np.frombuffer(texts[0].encode(), np.uint8)]
    for field, text in zip(fields, texts[1:], strict=True):
        parts += [field, np.frombuffer(text.encode(), np.uint8)]
    width = sum(part.shape[-1] for part in parts)
    content = bytearray(len(columns[0]) * width)
    table = np.frombuffer(content, np.uint8).reshape(-1, width)
    column = 0
    for part in parts:
        table[:, column : column + part.shape[-1]] = part
        column += part.shape[-1]
    return content.translate(None, b"\0")


def _field(values: NDArray[Any], decimals: int | None) -> NDArray[Any]:
    """A column as a table of bytes."""
    if decimals is not None:
        return _digits(values, decimals)
    import numpy as np

    return values.astype("S").view(np.uint8).reshape(len(values), -1)


def _digits(values: NDArray[Any], decimals: int) -> NDArray[Any]:
    """Each value as decimal digits, one byte a digit, zero bytes before them."""
    import numpy as np

    scaled = _scaled(values, decimals)
    size = np.abs(scaled)
    places = max(len(str(int(size.max()))), decimals + 1)
    groups = -(-places // 4)
    # Four digits at a time, from a table of all ten thousand.
    table = np.arange(10_000)[:, None] // [1000, 100, 10, 1] % 10 + ord("0")
    quads = np.ascontiguousarray(table, np.uint8).view(np.uint32).ravel()
    words = np.empty((len(size), groups), np.uint32)
    rest = size
    for group in reversed(range(groups)):
        rest, lowest = np.divmod(rest, 10_000)
        words[:, group] = quads[lowest]
    digits = words.view(np.uint8)[:, 4 * groups - places :]
    whole = places - decimals
    for place in range(whole - 1):
        digits[size < 10 ** (places - 1 - place), place] = 0
    field = np.empty((len(size), 1 + places + (decimals > 0)), np.uint8)
    field[:, 0] = np.where(scaled < 0, ord("-"), 0)
    field[:, 1 : 1 + whole] = digits[:, :whole]
    if decimals:
        field[:, 1 + whole] = ord(".")
        field[:, 2 + whole :] = digits[:, whole:]
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
