"""Results of a run as differentiable functions of numbers of the drive: for SciPy, JAX and PyTorch."""
