"""What several studies share: one measured run, what a study found and wrote."""
