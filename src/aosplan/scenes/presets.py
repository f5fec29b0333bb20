"""Scene presets: forests by name.

Each preset describes a stand by the model of the paper: one uniform volume of occluders of one
size.  Real stands are not uniform, so a preset is a starting point for a plan and not a prediction
for a place.  Each preset names its published values (``source``) and its assumed values
(``assumed``).

The numbers of a preset were chosen as follows, unless its texts say otherwise:

- ``integrated_density`` is one minus the gap fraction of vertical rays (:func:`gap_fraction`).  It
  is computed from a published leaf area index (one-sided; half of the total surface for needles; m²
  per m² of ground) and a clumping index.  The area of wood is not added to the leaf area.  The
  errors of leaf area and clumping are estimated as 20 % each.  The error of p is then 0.1 in the
  middle of its range.
- ``volume_base_m`` determines the baseline, because the lowest occluders need the largest baseline.
  It is a mean height of the crown base, or is fitted to a measured profile of leaves above 2 m.
  Dead branches, young trees and shrubs below this height are not included.  If they matter, use a
  lower value.
- ``occluder_size_m`` is always assumed, because it is not published. Baselines are proportional to
  the occluder size.
"""

from __future__ import annotations

from math import exp, log1p, nan
from typing import NamedTuple

from aosplan.scenes.scene import UniformScene

__all__ = ["SCENES", "ScenePreset", "gap_fraction"]


class ScenePreset(NamedTuple):
    """A stand as one uniform volume of occluders. Heights are above ground, in metres.

    Attributes
    ----------
    title
        Short description of the stand.
    integrated_density
        Share p of the ground that a single nadir photo does not see, in (0, 1).
    occluder_size_m
        Edge length of an occluder, such as a leaf cluster or a branch.
    volume_base_m
        Height of the lower end of the volume.
    volume_height_m
        Thickness of the volume; its top is at base plus thickness.
    source
        Publications, each with the values that were taken from it.
    assumed
        The values that are not in a named source, and the reason for each value.
    """

    title: str
    integrated_density: float
    occluder_size_m: float
    volume_base_m: float
    volume_height_m: float
    source: str
    assumed: str


def gap_fraction(
    leaf_area_index: float, clumping_index: float = 1.0, projection: float = 0.5
) -> float:
    r"""Share of the ground that is visible through a canopy from vertically above.

    Beer-Lambert extinction by leaves: :math:`P = \exp(-G\,\Omega\,L)`. The integrated density p of
    a single nadir view is 1 - P.

    Parameters
    ----------
    leaf_area_index
        L, one-sided leaf area per ground area (m²/m²), L >= 0.  If the occluders are not only
        leaves, use a plant area index or a wood area index.
    clumping_index
        Ω > 0.  It is 1 for randomly placed leaves, less than 1 if leaves are clumped in shoots and
        crowns, and more than 1 if they are regularly spaced.  Forests have 0.5 to 0.9.
    projection
        G, mean projection of unit leaf area on the ground, in [0, 1]: 0.5 for a spherical
        distribution of leaf angles, 1 for horizontal leaves, near 0 for vertical leaves.

    Returns
    -------
    float
        P in [0, 1]; nan outside the domain.

    Notes
    -----
    The law is published in [1]_. [2]_ derives it from gaps between random, clumped or regular
    leaves. [3]_ contains a map of Ω for the vegetation of the world.  Off nadir, the exponent is
    multiplied by the secant of the view angle.

    References
    ----------
    .. [1] M. Monsi, T. Saeki, "Über den Lichtfaktor in den Pflanzengesellschaften und seine
       Bedeutung für die Stoffproduktion", Japanese Journal of Botany 14, 22-52, 1953.
    .. [2] T. Nilson, "A theoretical analysis of the frequency of gaps in plant stands",
       Agricultural Meteorology 8, 25-38, 1971.
    .. [3] J. M. Chen, C. H. Menges, S. G. Leblanc, "Global mapping of foliage clumping index using
       multi-angular satellite data", Remote Sensing of Environment 97, 447-457, 2005.

    Examples
    --------
    >>> round(gap_fraction(5.0, clumping_index=0.7), 3)
    0.174
    """
    if leaf_area_index >= 0 and clumping_index > 0 and 0 <= projection <= 1:
        return exp(-projection * clumping_index * leaf_area_index)
    return nan


# The paper gives only ratios of the lengths of its forest. The ratio l/o is computed from Eq. 1, p
# = 1 - (1 - D)^(l/o). Let H be the height above which 98 % of the occluders are. Occluders at H
# have d̂ = 1 at b = o h / H, so that H/o = h/b.
_PAPER_DENSITY = 0.567
_PAPER_DENSITY_PER_SLICE = 0.0095
_PAPER_VOLUME_PER_OCCLUDER = log1p(-_PAPER_DENSITY) / log1p(-_PAPER_DENSITY_PER_SLICE)  # 87.69
_PAPER_HEIGHT_PER_OCCLUDER = 50 / 3.5  # 14.29

_BEPS = (
    "in the parameters of the BEPS model, version 4.10 (University of Toronto; model: Liu, Chen, "
    "Cihlar, Park 1997, Remote Sensing of Environment 62:158-175)"
)
_SPHERICAL = "projection 0.5 (spherical leaf angles)"

# For stands with a stem count, a comment gives the shaded area per tree, p / stems. This area has
# to be smaller than the growing space of a tree, 1 / stems, and similar to the area of a crown.
SCENES: dict[str, ScenePreset] = {
    "paper-forest": ScenePreset(
        title="The paper's LiDAR forest",
        integrated_density=_PAPER_DENSITY,
        occluder_size_m=0.20,
        volume_base_m=0.20 * (_PAPER_HEIGHT_PER_OCCLUDER - 0.02 * _PAPER_VOLUME_PER_OCCLUDER),
        volume_height_m=0.20 * _PAPER_VOLUME_PER_OCCLUDER,
        source=(
            "Kurmi, Schedl, Bimber 2019, A Statistical View on Synthetic Aperture Imaging for "
            "Occlusion Removal, IEEE Sensors Journal 19(20): density per slice 0.95 %, integrated "
            "density 56.7 %, hence l/o = 87.69 by its Eq. 1; baseline 3.5 m at 50 m for 98 % of "
            "the occluders, hence H/o = 14.29 at the 2 % quantile of height"
        ),
        assumed=(
            "occluder size 0.20 m, which determines all heights, because the paper gives "
            "only ratios; with 0.20 m, the stand is 20 m tall"
        ),
    ),
    "savanna": ScenePreset(
        title="Eucalypt savanna, northern Australia",
        integrated_density=1 - gap_fraction(1.0, clumping_index=0.63),
        occluder_size_m=0.20,
        volume_base_m=6.0,
        volume_height_m=9.0,
        source=(
            "O'Grady, Chen, Eamus, Hutley 2000, Australian Journal of Botany 48:629-638, "
            "Eucalyptus miniata and E. tetrodonta near Darwin: LAI = 1.0 at its yearly maximum; "
            "OzFlux site Howard Springs, same trees: mean height 14 to 16 m; clumping index 0.63: "
            f"evergreen broadleaf forest {_BEPS}"
        ),
        assumed=(
            "crown base at 0.4 of the height; occluder size 0.20 m (leaf sprays at twig "
            f"ends); {_SPHERICAL}, which is too large for hanging eucalypt leaves, so p is "
            "an upper estimate"
        ),
    ),
    # 14 m² per tree: a crown 4.2 m wide, in a growing space of 29 m².
    "open-woodland": ScenePreset(
        title="Open ponderosa pine, 339 stems/ha",
        integrated_density=1 - gap_fraction(2.1, clumping_index=0.62),
        occluder_size_m=0.25,
        volume_base_m=7.2,
        volume_height_m=10.8,
        source=(
            "AmeriFlux site US-Me2 (Metolius mature ponderosa pine, Oregon, after Irvine et al. "
            "2008): overstorey LAI = 2.1, height 18 m, 339 stems/ha; clumping index 0.62: "
            f"evergreen needleleaf forest {_BEPS}"
        ),
        assumed=(
            "crown base at 0.4 of the height; occluder size 0.25 m (tufts of long needles at "
            f"branch ends); {_SPHERICAL}; the understorey, LAI = 0.2, is left out"
        ),
    ),
    # 8.6 m² per tree: a crown 3.3 m wide, in a growing space of 14 m².
    "boreal-pine": ScenePreset(
        title="Boreal Scots pine, 700 stems/ha",
        integrated_density=1 - gap_fraction(3.0, clumping_index=0.62),
        occluder_size_m=0.25,
        volume_base_m=11.0,
        volume_height_m=8.5,
        source=(
            "SMEAR II, Hyytiälä, Finland (University of Helsinki; SpecNet site page): about 700 "
            "pines/ha, all-sided needle area 6 m²/m² after thinning, hence LAI = 3.0; Korhonen, "
            "Repola, Karjalainen, Packalen, Maltamo 2019, Silva Fennica 53(3) 10179, Table 1, 414 "
            "pines at Kiihtelysvaara: mean height 19.5 m, mean crown base 11.0 m; clumping index "
            f"0.62: evergreen needleleaf forest {_BEPS}"
        ),
        assumed=(
            "both stands are assumed to be similar, although the second counts only "
            "sawlog-sized trees; occluder size 0.25 m (needle-bearing branch ends); "
            f"{_SPHERICAL}; young spruce below the pines is left out"
        ),
    ),
    # 4.1 m² per pine: a crown 2.3 m wide, in a growing space of 6.2 m².
    "plantation": ScenePreset(
        title="Loblolly pine plantation, 1600 stems/ha",
        integrated_density=1 - gap_fraction(3.5, clumping_index=0.62),
        occluder_size_m=0.25,
        volume_base_m=10.2,
        volume_height_m=6.8,
        source=(
            "Duke Forest, North Carolina, planted 1983 (Duke FACE site characteristics; AmeriFlux "
            "site US-Dk3): 1600 pines/ha, canopy height 16 m in 2001 and 18 m in 2004; Zhao, Kane, "
            "Borders 2012, Open Journal of Forestry 2:110-115: live crown ratio 0.40 as the "
            "critical point for thinning; Körner 2013 in Strasburger's Plant Sciences, p. 1070: "
            "pine forests LAI = 3 to 4; clumping index 0.62: evergreen needleleaf forest "
            f"{_BEPS}"
        ),
        assumed=(
            "LAI = 3.5 and height 17 m, the middle of both ranges; crown ratio 0.40; "
            f"occluder size 0.25 m (tufts of long needles at branch ends); {_SPHERICAL}; "
            "hardwoods below the pines are left out"
        ),
    ),
    "mixed-forest": ScenePreset(
        title="Temperate mixed forest (oak, maple, hemlock, pine)",
        integrated_density=1 - gap_fraction(5.1, clumping_index=0.66),
        occluder_size_m=0.20,
        volume_base_m=2.7,
        volume_height_m=18.6,
        source=(
            "Harvard Forest, Massachusetts, in Wohlfahrt et al. 2015, Atmospheric Chemistry and "
            "Physics 15, Table 1: LAI = 4.8 to 5.4, canopy height 23 m; Harvard ForestGEO plot: "
            "over 116 000 woody stems from 1 cm on 35 ha, 3300 stems/ha; clumping index between "
            f"0.62, evergreen needleleaf, and 0.70, deciduous broadleaf forest, {_BEPS}"
        ),
        assumed=(
            "the middle of both ranges, LAI = 5.1 and clumping index 0.66; leaves distributed over "
            "the height as in broadleaf-forest, scaled to 23 m; occluder size 0.20 m (leaf and "
            f"needle sprays at twig ends); {_SPHERICAL}"
        ),
    ),
    # 22 m² per tree: a crown 5.2 m wide, in a growing space of 24 m². The canopy is closed.
    "conifer-forest": ScenePreset(
        title="Norway spruce, 50 years, 410 stems/ha",
        integrated_density=1 - gap_fraction(7.0, clumping_index=0.62),
        occluder_size_m=0.20,
        volume_base_m=8.1,
        volume_height_m=15.9,
        source=(
            "Wetzstein, Thuringia, in Rödig, Huth, Bohn, Rebmann, Cuntz 2017, Forest Ecosystems "
            "4:4, Table 1: LAI = 7.0, 410 stems/ha; Max Planck Institute for Biogeochemistry, site "
            "page: height 24 m; Finnish Forest Research Institute, four monitored spruces of 14.5 "
            "to 28.5 m: crown base at 0.34 of the height on average; clumping index 0.62: "
            f"evergreen needleleaf forest {_BEPS}. Temperate evergreen forests average LAI = 5.1 "
            "to 6.7 (Asner, Scurlock, Hicke 2003, Global Ecology and Biogeography 12:191-205)"
        ),
        assumed=(
            "the optically measured LAI is assumed not to be reduced by clumping (otherwise "
            "p = 0.97); Finnish crown ratios; occluder size 0.20 m (sprays of twigs along a "
            f"branch); {_SPHERICAL}"
        ),
    ),
    "broadleaf-forest": ScenePreset(
        title="Broadleaf forest in leaf (maple, basswood, ash)",
        integrated_density=1 - gap_fraction(5.36, clumping_index=0.70),
        occluder_size_m=0.20,
        volume_base_m=2.8,
        volume_height_m=19.6,
        source=(
            "AmeriFlux site Willow Creek, Wisconsin, core measurements: LAI = 5.36 from "
            "litter traps, canopy height 24.2 m, LAI by metre of height (above 2 m, the mean "
            "height is 12.6 m and the 2 % quantile is 3.2 m, as in the volume); clumping "
            f"index 0.70: deciduous broadleaf forest {_BEPS}. Beech is similar: plant area "
            "index 5.1, crowns up to 35 m (Hainich); LAI = 4.2, 224 stems/ha, trees up to 37 "
            "m (Leinefelde) (University of Göttingen, site pages)"
        ),
        assumed=(
            "leaves below 2 m do not count as canopy; occluder size 0.20 m (leaf sprays at "
            f"twig ends); {_SPHERICAL}, which is too small for horizontal shade leaves, so p "
            "is a lower estimate; the crown base of even-aged beech is much higher"
        ),
    ),
    "broadleaf-leafless": ScenePreset(
        title="The same broadleaf forest in winter",
        integrated_density=1 - gap_fraction(0.75),
        occluder_size_m=0.10,
        volume_base_m=2.8,
        volume_height_m=19.6,
        source=(
            "Volume: broadleaf-forest. Wood area index: about 0.5 seen by a canopy analyser "
            "(Kucharik, Norman, Gower 1998, Agricultural and Forest Meteorology 91:69-88, as "
            "reported in the technical note of the FATES model); generally below 1 (Körner 2013 in "
            "Strasburger's Plant Sciences, p. 1070)"
        ),
        assumed=(
            "wood area index 0.75, between the two values of the sources; no clumping; wood at the heights of the "
            "leaves; occluder size 0.10 m (limbs and bundles of twigs); projection 0.5 (branches "
            "in all directions)"
        ),
    ),
    "tropical-forest": ScenePreset(
        title="Tropical rain forest, old growth",
        integrated_density=1 - gap_fraction(6.0, clumping_index=0.63),
        occluder_size_m=0.25,
        volume_base_m=2.0,
        volume_height_m=22.6,
        source=(
            "Clark, Olivas, Oberbauer, Clark, Ryan 2008, Ecology Letters 11:163-172, La Selva, "
            "Costa Rica, all leaves harvested from floor to top: LAI = 6.00; Barro Colorado "
            "Island, Panama (FORMIND model, site page): mean canopy height 24.6 m, standard "
            f"deviation 8.2 m; clumping index 0.63: evergreen broadleaf forest {_BEPS}"
        ),
        assumed=(
            "both forests are assumed to be similar; leaves fill the height evenly from 2 m "
            "upwards; plants below 2 m are left out; occluder size 0.25 m (large leaves and "
            f"their clusters); {_SPHERICAL}; trees above the mean canopy height are left out"
        ),
    ),
    "dense-forest": ScenePreset(
        title="Dense young spruce, about 20 years",
        integrated_density=1 - gap_fraction(10.0, clumping_index=0.62),
        occluder_size_m=0.15,
        volume_base_m=1.5,
        volume_height_m=8.5,
        source=(
            "Kram 1998, Polish Journal of Ecology 46(1): spruce has the highest LAI of the species "
            "measured, 10.0, and stands peak at about 20 years; Körner 2013 in Strasburger's Plant "
            "Sciences, p. 1070: LAI up to 10 for dense spruce plantations; clumping index 0.62: "
            f"evergreen needleleaf forest {_BEPS}"
        ),
        assumed=(
            "height 10 m and green branches down to 1.5 m; occluder size 0.15 m (short sprays of "
            f"twigs); {_SPHERICAL}"
        ),
    ),
}


WORDS = {
    "savanna": "savannah eucalyptus bush",
    "open-woodland": "ponderosa pine pinus park conifer sparse",
    "boreal-pine": "scots pine pinus taiga conifer",
    "plantation": "loblolly pine pinus conifer",
    "mixed-forest": "oak quercus maple acer hemlock tsuga pine temperate",
    "conifer-forest": "norway spruce picea fir abies coniferous needle mature",
    "broadleaf-forest": "broadleaved deciduous maple acer basswood lime tilia ash fraxinus beech fagus "
    "oak birch hardwood summer leaf-on",
    "broadleaf-leafless": "broadleaved deciduous beech oak birch winter leaf-off bare",
    "tropical-forest": "rainforest jungle amazon",
    "dense-forest": "young spruce picea thicket coniferous",
}
"""Additional search words for the presets: species, genera and kinds of forest."""


def scenes_by_word(word: str) -> list[str]:
    """Names of the presets whose name, title or search words contain a word."""
    wanted = word.lower().strip()
    texts = {
        name: f"{name} {preset.title.lower()} {WORDS.get(name, '')}"
        for name, preset in SCENES.items()
    }
    return [name for name, text in texts.items() if wanted and wanted in text]


def scene_hint(name: str) -> str:
    """The hint that lists the presets that a name may refer to; empty if there is no such
    preset.
    """
    words = {word for part in [name, *name.split("-")] for word in part.split() if len(word) > 2}
    best: list[str] = scenes_by_word(name)
    for word in sorted(words, key=len, reverse=True) if not best else ():
        best = best or scenes_by_word(word)
    from aosplan.units import nearest_hint

    return f"did you mean {' or '.join(best[:4])}?" if best else nearest_hint(name, SCENES)


def find_preset_scene(name: str) -> UniformScene | None:
    """The scene of a preset; None if there is no such preset."""
    preset = SCENES.get(name)
    if preset is None:
        return None
    return UniformScene(
        name=name,
        density=None,
        occluder_size_m=preset.occluder_size_m,
        volume_base_m=preset.volume_base_m,
        volume_height_m=preset.volume_height_m,
        given_integrated_density=preset.integrated_density,
        title=preset.title,
        source=preset.source,
        assumed=preset.assumed,
    )
