"""Screens of lessons: each makes one question of a subject, its measured answer, and what there is to play with."""
