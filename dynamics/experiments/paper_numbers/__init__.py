"""The numbers of Kusaka and Tanaka (2025), measured."""
