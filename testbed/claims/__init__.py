"""Verdicts on the claims of the paper: premises, guarantees, the evading manoeuvre flown."""
