"""Control of a platform on several cylinders: path of the pose, a controller for each leg, and the run."""

from pneudrive.control.pose.legs import PoseScore, run_pose
from pneudrive.control.pose.path import PosePath, pose_path

__all__ = ["PosePath", "PoseScore", "pose_path", "run_pose"]
