"""Requirements in words: signal temporal logic over the columns of a run, with its robustness."""
