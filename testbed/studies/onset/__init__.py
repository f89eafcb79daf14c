"""When overriding begins, for several class-K functions and the navigation function."""
