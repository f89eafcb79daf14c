"""Tells whether a scenario draws random numbers: if it does not, every seed gives the same run."""

from __future__ import annotations

from testbed.scenario.scenario import Scenario
from testbed.scenario.start import RandomGoals


def random_fields(s: Scenario) -> list[str]:
    """Dotted names of the fields by which the seed may change a run; empty if it changes nothing."""
    g, start = s.gusts, s.start
    perturbed = [
        f"start.{name}"
        for name in ("lateral_perturbation_m", "heading_perturbation_deg", "height_perturbation_m")
        if getattr(start, name)
    ]
    perturbed += ["start.pattern"] if isinstance(start, RandomGoals) else []
    errors = [
        f"sensing.{name}"
        for name, value in s.sensing
        if any(kind in name.split("_") for kind in ("noise", "drift", "bias")) and value
        if name != "drift_time_s"
    ]
    # The unicycle flies its command over the ground whatever the wind.
    met = s.plant != "unicycle" or s.remedy.air_mass
    other = {
        "gusts": met and (bool(g.sigma_mps) if g.sigma_mps is not None else g.intensity != "none"),
        "gusts.jsbsim_turbulence": g.jsbsim_turbulence != "none",
        # A link that never carries anything draws nothing that matters.
        "network.loss": 0.0 < s.network.loss < 1.0,
    }
    return [*perturbed, *errors, *(name for name, drawn in other.items() if drawn)]
