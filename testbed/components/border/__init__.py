"""Calls parts of a user's own with copies of all arguments, and checks what they return.

A part of the catalogue is not wrapped. Every other part is called through a wrapper, which gives it arrays of
its own that cannot be written to, and checks shape, type and value of all that it returns. A part that breaks
its contract, or raises, ends the run with a `Breach` that names the part and the clause.
"""
