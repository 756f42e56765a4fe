"""Reports of flight records: figures, plots, a page for a browser, a table for a terminal."""
