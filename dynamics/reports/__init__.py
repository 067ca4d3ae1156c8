"""Reports: figures measured on scenes, as plain data for a page, a plot or a test."""
