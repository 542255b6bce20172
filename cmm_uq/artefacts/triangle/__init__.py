"""Triangle of gauge blocks and cylinders."""
