"""The machine: as its certificate states it, given its recording, and where its factors hold."""
