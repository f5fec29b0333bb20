"""Named targets and signatures, as plain values that are quick to load.

A signature describes the radiances of a target and of the canopy, in units of σ_c, the standard
deviation between occluders.  No published values are known.  All values are assumed.  For each
value, a range is given in which the true value is expected to be.
"""

from __future__ import annotations

from typing import NamedTuple

PERSON_M = (0.5, 1.7)
"""Width and length of a person lying on the ground [m]."""

FALSE_ALARMS = 1.0
"""Default number of false alarms per hectare."""


class Signature(NamedTuple):
    """Radiances of a target and of the canopy, in units of σ_c.

    Attributes
    ----------
    contrast
        C, radiance of the target minus that of the ground.
    canopy_offset
        M, mean radiance of the canopy minus that of the ground.
    crown_share
        Share of σ_c² that is common to whole crowns.
    """

    contrast: float
    canopy_offset: float
    crown_share: float


SIGNATURES = {
    "thermal-dawn": Signature(5.0, -1.0, 0.4),
    "thermal-noon": Signature(1.0, 2.0, 0.4),
    "colour": Signature(2.0, 1.0, 0.4),
}
"""Assumed signatures. The values are in the middle of the ranges in `RANGES`. For the signatures
``noon`` and ``colour``, they are in the upper half.
"""

RANGES = {
    "thermal-dawn": "C 2 to 8, M -2 to 0, crown share 0.3 to 0.5",
    "thermal-noon": "C -2 to 2, M 2, crown share 0.3 to 0.5",
    "colour": "C 1 to 3, M -1 or 1, crown share 0.3 to 0.5",
}
"""Ranges in which the values of a signature are expected to be.  These ranges are also assumed."""
