"""Exports of flights to other tools: Foxglove, Google Earth, spreadsheets, pandas."""
