"""What leaves the house: certificates in HTML and PDF, and results.json.

This room computes nothing. It takes what a command found, puts it into words, tables and plots as one
:class:`~cmm_uq.certificate.document.Document`, and renders that document twice.
"""
