"""The fidelity ladder: from the unicycle to an aircraft in weather, one departure at a time."""
