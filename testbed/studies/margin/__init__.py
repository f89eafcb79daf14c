"""The smallest setting of a remedy that meets a violation rate."""
