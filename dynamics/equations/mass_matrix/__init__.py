"""Mass matrix: systems of equations with M, solved by elimination or densely, and an M that is singular."""
