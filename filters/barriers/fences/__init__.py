"""Barrier functions of one vehicle and a fence: areas to stay in or out of, height bands, their gradients."""
