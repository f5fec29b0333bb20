"""Columns of targets below a slice, packed eight to an octet.

Bit i of an octet represents the i-th of eight neighbouring columns of targets. The bit is set if
this column is below an occupied voxel. A packed slice has the octets that begin at every eighth
column, from column 0 on.

Rays to one camera converge. Eight neighbouring targets therefore meet at most eight neighbouring
columns. Each target meets the same column as the target before it, or the next column. Let x be the
column that target 0 meets, and let k be the number of targets from 1 to i that meet the same column
as the target before them. Target i then meets column x + i - k. This is bit i of the octet that
begins at column x - k. The result for eight targets is therefore a bitwise OR of a few octets of
the slice. From each of these octets, only the bits of the targets with the same k are used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Octets = NDArray[np.uint8]


def packed(plane: NDArray[np.bool_], per_voxel: int, octets: int) -> Octets:
    """A slice as octets of columns of targets.

    Parameters
    ----------
    plane
        Shape (rows, columns) of voxels; the plot is periodic.
    per_voxel
        Columns of targets below each column of voxels.
    octets
        Number of octets.  Beyond the end of the plot, the columns begin again.

    Returns
    -------
    ndarray
        Shape (octets, rows).
    """
    columns = plane.shape[1] * per_voxel
    fine = plane.repeat(per_voxel, axis=1) if per_voxel > 1 else plane
    again = np.concatenate([fine] * -(-8 * octets // columns), axis=1)[:, : 8 * octets]
    return np.ascontiguousarray(np.packbits(again, axis=1, bitorder="little").T)


def advanced(octets: Octets, bit: int, following: Octets) -> Octets:
    """Octets that begin `bit` columns later, from 1 to 7. `following` are the octets that begin
    eight columns later.
    """
    moved = octets >> np.uint8(bit)
    # A multiplication is used, because a shift of octets to the left is slower than other
    # operations on octets.
    moved |= following * np.uint8(1 << (8 - bit))
    return moved


def from_each_column(octets: Octets) -> Octets:
    """The octets that begin at each column of a packed slice, shape (8 octets - 8, rows)."""
    first, following = octets[:-1], octets[1:]
    found = np.empty((8 * len(first), octets.shape[1]), dtype=np.uint8)
    found[0::8] = first
    for bit in range(1, 8):
        found[bit::8] = advanced(first, bit, following)
    return found


class MetColumns(NamedTuple):
    """Columns that the rays from targets to cameras meet in the given slices.

    Attributes
    ----------
    columns
        Shape (choices, slices, cameras, width): columns from which octets are taken.
    bits
        Shape (choices, slices, cameras, width, 1): the bits of these octets that are used.
    needed
        For each slice and camera, the choices of which at least one bit is used.
    """

    columns: NDArray[np.intp]
    bits: Octets
    needed: list[list[list[int]]]

    @classmethod
    def of(
        cls, met: NDArray[np.intp], plot: int, beside: NDArray[np.intp] | None = None
    ) -> MetColumns:
        """Find the columns that targets meet. A target may meet two neighbouring columns.

        Parameters
        ----------
        met
            Shape (slices, cameras, 8 * width): column that each target meets. It is the column of
            the target before it, or the next column.
        plot
            Number of columns of targets of the periodic plot.
        beside
            Array of the same shape: distance between the first and the second column of a target; 0
            if the target meets only one column.
        """
        eights = met.reshape(*met.shape[:2], -1, 8)
        first = eights[..., 0]
        same = first[..., np.newaxis] + np.arange(8) - eights
        alike = [_bits(same == k) for k in range(int(same.max(initial=0)) + 1)]
        columns, bits = [first - k for k in range(len(alike))], alike.copy()
        if beside is not None:
            moved = beside.reshape(eights.shape)
            for step in np.unique(beside[beside != 0]).tolist():
                second = _bits(moved == step)
                columns += [first - k + step for k in range(len(alike))]
                bits += [own & second for own in alike]
        found = np.stack(bits)
        some = np.moveaxis(np.asarray(found.any(axis=-1)), 0, -1)
        needed = [[np.flatnonzero(camera).tolist() for camera in level] for level in some]
        return cls(np.stack(columns) % plot, found[..., np.newaxis], needed)

    def hidden(self, octets: Octets, level: int) -> list[Octets]:
        """Mask of the targets that a slice hides from each camera, shape (width, rows).

        Parameters
        ----------
        octets
            Octets that begin at each column of the slice (`from_each_column`).
        level
            Index of the slice.
        """
        found = []
        for camera, (first, *others) in enumerate(self.needed[level]):
            met = octets.take(self.columns[first, level, camera], axis=0)
            met &= self.bits[first, level, camera]
            for choice in others:
                more = octets.take(self.columns[choice, level, camera], axis=0)
                more &= self.bits[choice, level, camera]
                met |= more
            found.append(met)
        return found


def _bits(chosen: NDArray[np.bool_]) -> Octets:
    return np.packbits(chosen, axis=-1, bitorder="little")[..., 0]
