"""The machine: effects that move points, and the model that joins them with artefact and noise."""
