"""Instruments and CMMs as live sources of readings: how each is spoken to, and what it says; stores and judges nothing."""
