"""Whether certificates say what their figures, inputs and signatures say; runs nothing again by itself."""
