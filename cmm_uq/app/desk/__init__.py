"""The desk: jobs begun, checked and certified in a browser on the same machine, on the same folders as the commands.

The server's process answers requests, writes files and shows records; whatever parses or computes runs in processes of its own
(:mod:`~cmm_uq.app.desk.workers`), which can be limited and ended. It is a role of :mod:`cmm_uq.app.serve.application`.
"""
