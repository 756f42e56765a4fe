"""A real flight put together from what each companion recorded."""
