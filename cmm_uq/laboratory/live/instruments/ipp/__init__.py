"""I++ DME (VDMA 8722): the lines of the protocol, a client, a CMM as a source, and servers to try it with."""
