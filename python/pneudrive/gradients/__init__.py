"""Results of a run as differentiable functions of drive parameters, for SciPy, JAX and PyTorch."""
