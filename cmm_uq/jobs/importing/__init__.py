"""Recordings in a laboratory's own format: recognised, said in full, and read as the columns of a recording.

A format (:mod:`~cmm_uq.jobs.importing.format`) makes sheets of a file: rows of cells and the line that each stands on. What
follows is the same for all: the header is found and its columns named, the decimal sign and the unit are settled, points are
numbered (:mod:`~cmm_uq.jobs.importing.recording`). What evidence does not settle is an error that names the key which does.
"""
