"""An axis calibrated by an artefact that is read in shifted places."""
