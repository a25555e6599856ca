"""Control of a platform on several cylinders: path of the pose, a controller for each leg, and the run."""
