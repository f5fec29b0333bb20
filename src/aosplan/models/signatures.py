"""Targets and signatures by name: plain values, so that a plan without a target loads nothing.

A signature says how a target and the canopy stand out, in units of the spread between occluders
σ_c.  No published figures are known for them: all are assumed, with a range in which they are to
be expected.
"""

from __future__ import annotations

from typing import NamedTuple

PERSON_M = (0.5, 1.7)
"""Width and length of a person lying on the ground [m]."""

FALSE_ALARMS = 1.0
"""False alarms a hectare, unless told otherwise."""


class Signature(NamedTuple):
    """How a target and the canopy stand out, in units of σ_c.

    Attributes
    ----------
    contrast
        C, the target's radiance over the ground's.
    canopy_offset
        M, the canopy's mean over the ground's.
    crown_share
        Share of σ_c² that whole crowns have in common.
    """

    contrast: float
    canopy_offset: float
    crown_share: float


SIGNATURES = {
    "thermal-dawn": Signature(5.0, -1.0, 0.4),
    "thermal-noon": Signature(1.0, 2.0, 0.4),
    "colour": Signature(2.0, 1.0, 0.4),
}
"""Assumed signatures: values in the middle of `RANGES`, for noon and colour in their upper half."""

RANGES = {
    "thermal-dawn": "C 2 to 8, M -2 to 0, crown share 0.3 to 0.5",
    "thermal-noon": "C -2 to 2, M 2, crown share 0.3 to 0.5",
    "colour": "C 1 to 3, M -1 or 1, crown share 0.3 to 0.5",
}
"""Within what the values of a signature are to be expected, assumed as well."""
