"""Questions that take many runs, one folder each: how it is flown, tabulated and drawn."""
