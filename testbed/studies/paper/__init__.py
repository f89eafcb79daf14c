"""The paper study."""
