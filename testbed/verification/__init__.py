"""A second opinion on finished runs: h and verdicts from the recorded positions, by formulas of its own."""
