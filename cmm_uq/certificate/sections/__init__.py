"""Sections of a certificate, in the order in which a customer asks for them."""
