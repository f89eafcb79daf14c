"""Does a test fail when the code is wrong? `make mutants` asks it for one small change at a time."""
