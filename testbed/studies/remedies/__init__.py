"""The remedies study."""
