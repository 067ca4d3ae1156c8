"""Steps: the steps of a method over the equations of a problem, equal or chosen, and what they leave."""
