"""Forces on bodies and at joints."""
