"""Studies and benchmarks of guidance laws and of this program."""
