"""What several studies share: one measured run, and the result that the command line prints."""
