"""The flow filter: a barrier function along the flow of a model with delays, lags and rate limits."""
