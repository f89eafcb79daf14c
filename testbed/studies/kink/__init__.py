"""The kink of the paper's turn barrier at equal headings."""
