"""States: values of graphs at them, and states that meet the constraints."""
