"""Pages: measured figures, plots and words on self-contained HTML pages, and as Markdown, CSV and JSON."""
