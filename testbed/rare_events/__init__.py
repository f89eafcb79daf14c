"""Estimates small probabilities with far fewer runs than plain sampling: importance sampling, subsets."""
