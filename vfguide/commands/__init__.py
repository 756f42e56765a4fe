"""What the command line does, by command."""
