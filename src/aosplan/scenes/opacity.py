"""Record of the method by which the opacity of a stand was found, with statistics of the laser
pulses.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

OpacitySource = Literal["auto", "pulses", "voxels"]
"""Source of the opacity: the laser pulses, or the points (a voxel is opaque if it contains a
point).
"""

SPARSE_POINTS_PER_M2 = 20.0
"""A cloud with fewer points per square metre than this is sparse. Such a cloud was recorded from an
aircraft, because terrestrial and photogrammetric clouds are denser.
"""

TEXTS = ("source", "reason", "energy")
COUNTS = ("pulses", "lines", "seed")


def is_sparse(points: int, area_m2: float) -> bool:
    """Whether a cloud with this number of points on a plot of this area [m²] is sparse."""
    return points < SPARSE_POINTS_PER_M2 * area_m2


class Opacity(NamedTuple):
    """The method by which the opacity of a volume was found.

    Attributes
    ----------
    source
        ``pulses`` or ``voxels``.
    reason
        Why the pulses were not used; empty if they were used or not requested.
    gap_first, gap_weighted, gap_last
        Share of the energy of the pulses that reaches the ground, for three assumptions.
        `gap_first`: the first return of each pulse has all the energy of the pulse. `gap_weighted`:
        the returns have the energies that were used for the fit. `gap_last`: the last return has
        all the energy. They are None without pulses.
    energy
        Energies of the returns: ``intensity`` (calibrated) or ``equal`` (1/n each).
    zenith_deg
        Smallest and largest zenith angle of the pulses.  Predictions for other angles are
        extrapolations.
    sampled_share
        Share of the voxels between the cut and the canopy top that at least one pulse crossed.
        Telecentric views cover every slice evenly. The value is therefore also the share of the
        path of a plan's rays that is inside such voxels.
    pulses, lines
        Number of pulses and of flight lines that were used.
    voxel_m, leaf_size_m
        Edge length of the voxels that have an attenuation, and edge length of the opaque cells that
        represent it.
    scale
        Scale factor of the attenuation, found by cross-fitting.
    scale_first, scale_last
        Scale factors that reproduce `gap_first` and `gap_last`.
    shrinkage
        Strength of the shrinkage of voxels towards larger blocks
        (`aosplan.scenes.pulses.attenuation`).
    seed
        Random seed of the opaque cells.
    """

    source: str
    reason: str = ""
    gap_first: float | None = None
    gap_weighted: float | None = None
    gap_last: float | None = None
    energy: str | None = None
    zenith_deg: tuple[float, float] | None = None
    sampled_share: float | None = None
    pulses: int | None = None
    lines: int | None = None
    voxel_m: float | None = None
    leaf_size_m: float | None = None
    scale: float | None = None
    scale_first: float | None = None
    scale_last: float | None = None
    shrinkage: float | None = None
    seed: int | None = None

    def to_document(self) -> dict[str, Any]:
        """All fields as plain values."""
        document = self._asdict()
        document["reason"] = self.reason or None
        if self.zenith_deg is not None:
            document["zenith_deg"] = list(self.zenith_deg)
        return document

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Opacity:
        """The inverse of `to_document`.

        Raises
        ------
        TypeError, ValueError
            If the document is not valid.
        """
        if not isinstance(document, dict):
            raise TypeError("its opacity is not a table")
        known: dict[str, Any] = {}
        for name in cls._fields:
            value = document.get(name)
            if value is None:
                continue
            if name == "zenith_deg":
                low, high = value
                known[name] = float(low), float(high)
            else:
                kind = str if name in TEXTS else int if name in COUNTS else float
                known[name] = kind(value)
        missing = set(cls._fields) - set(known) - {"reason"}
        if known.get("source") not in ("pulses", "voxels") or (
            known["source"] == "pulses" and missing
        ):
            raise ValueError("its opacity is not complete")
        return cls(**known)
