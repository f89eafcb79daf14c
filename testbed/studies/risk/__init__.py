"""What safety cases ask of recorded encounters: volumes lost, risk ratios, interventions, cost."""
