"""Events: where functions of a motion cross zero, located, logged, and what they reset."""
