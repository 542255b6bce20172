"""The page to look at: machines, certificates, artefacts and the state of the records, in a browser on the same machine.

It reads the records and the files that they name, and nothing else; it has no way to write. Pages are templates
(``templates/serve``) with their values; they work without a script, without a network, and from a keyboard.
"""
