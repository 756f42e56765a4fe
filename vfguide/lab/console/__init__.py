"""The console: a formation in the air, or a recorded flight, on a page of a browser, and orders from it."""
