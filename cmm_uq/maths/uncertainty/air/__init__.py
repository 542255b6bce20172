"""The refractive index of air, and what a laser interferometer makes of it."""
