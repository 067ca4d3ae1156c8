"""Bodies: masses on joints, joints composed of others, and where their coordinates stand in a state."""
