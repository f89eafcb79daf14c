"""Barrier functions h between pairs of vehicles, their gradients and class-K functions."""
