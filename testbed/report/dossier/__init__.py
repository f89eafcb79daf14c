"""A document for an authority: what was flown, how it was judged, and what was not covered."""
