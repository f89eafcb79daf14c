"""What the testbed costs beside JSBSim, and that speed changed no result. Not part of pass or fail."""
