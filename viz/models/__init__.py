"""What is shown of a model, in a line: its page, its motion."""
