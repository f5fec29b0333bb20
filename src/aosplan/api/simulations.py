"""Simulations of plans: `simulate`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from aosplan.api.plans import Plan, plan_of_request
from aosplan.api.request import found_request
from aosplan.api.summarized import Summarized
from aosplan.planning.loaded_scene import without_simulated_view
from aosplan.simulation import compare

if TYPE_CHECKING:
    from typing import Unpack

    from matplotlib.axes import Axes

    from aosplan.api.request import RequestLike
    from aosplan.api.request_options import RequestOptions


class Simulation(Summarized, compare.Simulation):
    """A plan's prediction and the result of its simulation.

    It has the attributes of `aosplan.simulation.compare.Simulation`: `predicted`, `simulated` (with
    standard errors), `agree`, `differences`.
    """

    __slots__ = ()

    def summary(self) -> tuple[str, dict[str, str]]:
        """The result as text: a headline and named values."""
        verdict = "agree" if self.agree else "disagree"
        headline = (
            f"Prediction and simulation {verdict}: {self.views} views of {self.targets} targets"
        )
        facts = {}
        for name, symbol in SYMBOLS.items():
            error = getattr(self.simulated, f"{name}_standard_error")
            facts[symbol] = (
                f"predicted {getattr(self.predicted, name):.4f}, simulated "
                f"{getattr(self.simulated, name):.4f} ± {error:.4f}"
            )
        facts["Forest"] = f"{self.settings.forest}, seed {self.settings.seed}"
        return headline, facts

    def columns(self) -> dict[str, list[Any]]:
        """Predicted and simulated density, V and V̂ with standard errors, as columns."""
        return {
            "quantity": list(SYMBOLS),
            "predicted": [getattr(self.predicted, name) for name in SYMBOLS],
            "simulated": [getattr(self.simulated, name) for name in SYMBOLS],
            "standard_error": [
                getattr(self.simulated, f"{name}_standard_error") for name in SYMBOLS
            ],
        }

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw predicted and simulated p, V and V̂ with error bars of two standard errors.

        Parameters
        ----------
        ax
            Axes to draw on; a new figure by default.
        """
        from aosplan.show.figures.axes import axes_or_new

        ax = axes_or_new(ax, (4.5, 3.2))
        table, places = self.columns(), range(len(SYMBOLS))
        errors = [2.0 * error for error in table["standard_error"]]
        ax.errorbar(
            places, table["simulated"], errors, fmt="o", capsize=4, label="simulated ± 2 s.e."
        )
        ax.plot(places, table["predicted"], "_", ms=22, label="predicted")
        ax.set(xticks=list(places), xlim=(-0.5, 2.5), ylim=(0.0, 1.02), ylabel="share")
        ax.set_xticklabels([r"density $p$", r"visibility $V$", r"normalised $\hat{V}$"])
        ax.legend(loc="lower right")
        return ax


SYMBOLS = {"density": "p", "expected": "V", "normalized": "V̂"}


def simulate(
    request: RequestLike | None = None,
    *,
    seed: int = 1,
    precision: float = 0.005,
    forest: str | None = None,
    occluders: str = "cubes",
    max_targets: int = compare.MOST_TARGETS,
    **options: Unpack[RequestOptions],
) -> Simulation:
    """Check a plan against a simulated forest.

    The simulated visibility is compared with the prediction.

    Parameters
    ----------
    request
        As for `aosplan.plan`; if an earlier plan is given, it is not solved again.
    seed
        Random seed, at least 0.
    precision
        Standard error of V and V̂ at which the simulation stops.
    forest
        ``noise``, ``uniform``, ``layered``, ``clumped`` or ``cloud``; by default the kind of forest
        that corresponds to the scene.
    occluders
        Occluders of generated volumes: ``cubes``, which have side faces, or ``leaves``, which are
        flat and have random directions.
    max_targets
        Largest number of targets.  The simulation stops there, even if `precision` is not reached.
    **options
        As for `aosplan.plan`.

    Raises
    ------
    RequestError
        In the same cases as `aosplan.plan`, or if the kind of forest is not possible for the scene.

    Examples
    --------
    >>> import aosplan
    >>> found = aosplan.simulate(altitude=40, vhat=0.9, forest="noise", precision=0.02)
    >>> found.agree
    True
    """
    from aosplan.units import index, one_of, positive, whole

    settings = compare.Settings(
        seed=index(seed, "seed"),
        precision=positive(precision, "precision"),
        forest=None if forest is None else one_of(compare.FORESTS)(forest, "forest"),
        occluders=one_of(compare.OCCLUDERS)(occluders, "occluders"),
        most_targets=whole(max_targets, "max_targets"),
    )
    if isinstance(request, Plan) and not options:
        planned, view = request, request.request.view
    else:
        found = found_request(request, options)
        view = found.request.view
        planned = plan_of_request(found._replace(request=without_simulated_view(found.request)))
    given: Any = view or "perspective"  # The request has been checked, so the value is valid.
    return Simulation(*compare.simulate(planned, settings._replace(view=given)))
