"""The command line's verbs, one file each: `add(parser)` declares the arguments, `run(arguments)` does it and returns the exit code."""
