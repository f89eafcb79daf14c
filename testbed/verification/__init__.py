"""Checks finished runs a second time: h and verdicts from the record, by formulas of its own."""
