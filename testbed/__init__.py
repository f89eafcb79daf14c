"""How we measure: scenarios, the simulation loop, guarantees, reports."""
