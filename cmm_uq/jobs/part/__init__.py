"""The job of a part: its features and how they are probed, datums, characteristics, and the machine that measures it.

Files are read and checked; contact points and normals follow from each feature's strategy, and nothing else is computed.
"""
