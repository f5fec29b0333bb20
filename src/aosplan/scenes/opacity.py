"""How the opacity of a stand was found, and what its laser pulses say of it."""

from __future__ import annotations

from typing import Any, Literal, NamedTuple

OpacitySource = Literal["auto", "pulses", "voxels"]
"""Where opacity comes from: the pulses, or voxels that are opaque if they hold a point."""


TEXTS = ("source", "reason", "energy")
COUNTS = ("pulses", "lines", "seed")


class Opacity(NamedTuple):
    """How the opacity of a volume was found.

    Attributes
    ----------
    source
        ``pulses`` or ``voxels``.
    reason
        Why the pulses were not used; empty if they were, or were not asked for.
    gap_first, gap_weighted, gap_last
        Share of the pulses' energy that reaches the ground if the first return of each pulse had
        all of it, if the returns have the energies that were used, and if the last return had
        all of it.  None without pulses.
    energy
        Energies of the returns: ``intensity``, calibrated, or ``equal``, 1/n each.
    zenith_deg
        Smallest and largest zenith angle of the pulses: what lies outside is extrapolated.
    sampled_share
        Share of the voxels between the cut and the canopy's top that pulses crossed.  As
        telecentric views cover every slice evenly, it is the share of a plan's rays as well.
    pulses, lines
        Number of pulses, and of flight lines, that were used.
    voxel_m, leaf_size_m
        Edge of the voxels of the attenuation, and of the cells that realise it.
    scale
        Factor of the attenuation from cross-fitting.
    scale_first, scale_last
        The factors that give the gaps of first and of last returns.
    shrinkage
        Strength of the shrinkage through the pyramid.
    seed
        Seed of the realisation.
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
        """All of it as plain values."""
        document = self._asdict()
        document["reason"] = self.reason or None
        if self.zenith_deg is not None:
            document["zenith_deg"] = list(self.zenith_deg)
        return document

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Opacity:
        """What `to_document` made plain.

        Raises
        ------
        TypeError, ValueError
            If it is something else.
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
