"""Autopilots as equations: the language, its compiler to a JSBSim system, which of them an airframe flies."""
