"""What this program is measured by, beside others that do the same."""
