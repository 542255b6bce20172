"""Effects of the machine, its probe, its temperature and its artefacts: one family a file."""
