"""Lessons: screens of one form, predict, reveal, play, about any system, on one page that loads nothing."""
