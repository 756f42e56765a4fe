"""What a flight record says: figures, plots, a page for a browser, a table for a terminal."""
