"""Questions that take many runs: how well the paper is reproduced, when overriding begins, the kink."""
