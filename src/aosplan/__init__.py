"""aosplan: sampling plans for airborne optical sectioning.

Modules of public names are imported when the names are first used. This makes ``import aosplan``
fast.
"""

from __future__ import annotations

# Type checkers treat this name as true. Importing it from typing would take time.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from aosplan.api.flown import Review as Review
    from aosplan.api.flown import Thinning as Thinning
    from aosplan.api.flown import review as review
    from aosplan.api.flown import thin as thin
    from aosplan.api.integrals import Integral as Integral
    from aosplan.api.integrals import integrate as integrate
    from aosplan.api.papers import PaperFigure as PaperFigure
    from aosplan.api.papers import paper_figure as paper_figure
    from aosplan.api.plans import Plan as Plan
    from aosplan.api.plans import Tradeoff as Tradeoff
    from aosplan.api.plans import export as export
    from aosplan.api.plans import plan as plan
    from aosplan.api.plans import tradeoff as tradeoff
    from aosplan.api.scenes import Stand as Stand
    from aosplan.api.scenes import read_scene as read_scene
    from aosplan.api.simulations import Simulation as Simulation
    from aosplan.api.simulations import simulate as simulate
    from aosplan.api.sweeps import Sweep as Sweep
    from aosplan.api.sweeps import sweep as sweep
    from aosplan.camera.camera import Camera as Camera
    from aosplan.errors import AosplanError as AosplanError
    from aosplan.errors import InfeasibleError as InfeasibleError
    from aosplan.errors import RequestError as RequestError
    from aosplan.models.equations import aperture as aperture
    from aosplan.models.equations import mean_squared_error as mean_squared_error
    from aosplan.models.equations import normalized_visibility as normalized_visibility
    from aosplan.models.equations import required_samples as required_samples
    from aosplan.models.equations import visibility as visibility
    from aosplan.models.equations import visibility_limits as visibility_limits
    from aosplan.models.equations import visibility_shortfall as visibility_shortfall
    from aosplan.models.layered import layered_shortfall as layered_shortfall
    from aosplan.models.layered import layered_visibility as layered_visibility
    from aosplan.models.positions import lattice_shortfall as lattice_shortfall
    from aosplan.models.positions import positions_shortfall as positions_shortfall
    from aosplan.planning.request import PlanRequest as PlanRequest
    from aosplan.scenes.density import integrated_density as integrated_density
    from aosplan.scenes.density import slice_density as slice_density
    from aosplan.scenes.density import transparency as transparency
    from aosplan.scenes.scene import Layer as Layer
    from aosplan.scenes.scene import LayeredScene as LayeredScene
    from aosplan.scenes.scene import UniformScene as UniformScene

__version__ = "0.1.0"

_HOMES = {
    "AosplanError": "errors",
    "Camera": "camera.camera",
    "InfeasibleError": "errors",
    "Integral": "api.integrals",
    "Layer": "scenes.scene",
    "LayeredScene": "scenes.scene",
    "PaperFigure": "api.papers",
    "Plan": "api.plans",
    "PlanRequest": "planning.request",
    "RequestError": "errors",
    "Review": "api.flown",
    "Simulation": "api.simulations",
    "Stand": "api.scenes",
    "Sweep": "api.sweeps",
    "Thinning": "api.flown",
    "Tradeoff": "api.plans",
    "UniformScene": "scenes.scene",
    "aperture": "models.equations",
    "export": "api.plans",
    "integrate": "api.integrals",
    "integrated_density": "scenes.density",
    "lattice_shortfall": "models.positions",
    "layered_shortfall": "models.layered",
    "layered_visibility": "models.layered",
    "mean_squared_error": "models.equations",
    "normalized_visibility": "models.equations",
    "paper_figure": "api.papers",
    "plan": "api.plans",
    "positions_shortfall": "models.positions",
    "read_scene": "api.scenes",
    "required_samples": "models.equations",
    "review": "api.flown",
    "simulate": "api.simulations",
    "slice_density": "scenes.density",
    "sweep": "api.sweeps",
    "thin": "api.flown",
    "tradeoff": "api.plans",
    "transparency": "scenes.density",
    "visibility": "models.equations",
    "visibility_limits": "models.equations",
    "visibility_shortfall": "models.equations",
}

__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 (the names are resolved by __getattr__)


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'aosplan' has no attribute '{name}'")
    from importlib import import_module

    value = getattr(import_module(f"aosplan.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
