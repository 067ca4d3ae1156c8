"""Hamilton's equations and the momenta that they keep."""
