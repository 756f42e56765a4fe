"""The replay inside the report: the flight as numbers for a browser, and the program that shows them."""
