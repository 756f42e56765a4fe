"""A flight for other tools: Foxglove, Google Earth, spreadsheets, pandas."""
