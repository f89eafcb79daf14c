"""What is counted at every step of a run."""
