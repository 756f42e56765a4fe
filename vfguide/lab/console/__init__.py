"""The console: a browser page that shows a formation in the air or a recorded flight, and gives orders."""
