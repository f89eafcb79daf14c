"""Reads flight logs, identifies the lags of the aircraft that flew, and flies its commands again."""
