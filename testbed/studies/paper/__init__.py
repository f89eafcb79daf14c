"""The paper's figures flown again."""
