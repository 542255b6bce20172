"""The uncertainty of what is measured on a part: virtual measurements of its plan on a machine as its certificate states it.

Nominal contact points of a plan are moved by draws of every cause, associated to features, aligned and evaluated to
characteristics. Nothing here parses text or renders any.
"""
