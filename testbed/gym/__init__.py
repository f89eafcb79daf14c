"""Scenarios as environments of Gymnasium (one vehicle learns) and PettingZoo (all do); needs the extra `gym`.

from testbed.gym.ego import EgoEnvironment
from testbed.gym.fleet import FleetEnvironment
"""
